"""`lfa bench operate`: how soon a fleet stands after `lfa stop`; whether a new leader goes where the old was sent."""

from lfa.deploy.bench.operate.figures import run

__all__ = ["run"]
