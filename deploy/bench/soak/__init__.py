"""`lfa bench soak`: what a team's processes hold after a long time of faults, beside what they held at its start."""

from lfa.deploy.bench.soak.measure import run

__all__ = ["run"]
