"""`lfa bench agents`: cost of agents in teams of 4, 20 and 50 processes, how soon they agree, if they keep time."""

from lfa.deploy.bench.agents.teams import run

__all__ = ["run"]
