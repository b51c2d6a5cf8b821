"""The operator's side: start a fleet, watch it, judge it. The `lfa` command lives here.

May import every other package; heavy libraries are imported inside the command that needs them.
"""
