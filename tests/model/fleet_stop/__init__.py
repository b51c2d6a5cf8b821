"""The fleet stop, model-checked: rules, model, and the comparison of `protocol/fleet_stop` with the rules."""
