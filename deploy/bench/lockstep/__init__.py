"""`lfa bench lockstep`: speed of agents' processes in virtual time, beside the same run in one process."""

from lfa.deploy.bench.lockstep.measure import run

__all__ = ["run"]
