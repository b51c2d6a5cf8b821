"""`lfa bench sim`: how many times faster than real time a team is simulated, and how its cost grows with the team."""

from lfa.deploy.bench.sim.speed import run

__all__ = ["run"]
