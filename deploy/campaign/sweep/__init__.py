"""Sweeps: a scenario over seeds, parameters, controllers and faults, as a campaign of simulated runs."""
