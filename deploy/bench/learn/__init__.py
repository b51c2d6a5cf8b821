"""`lfa bench learn`: how many steps a second a learner gets from the team, beside the simulators VMAS and navground."""

from lfa.deploy.bench.learn.measure import run

__all__ = ["run"]
