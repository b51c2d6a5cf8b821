"""`lfa bench latency`: time from a predecessor's pose to its successor's command, and what grows with the chain."""

from lfa.deploy.bench.latency.measure import run

__all__ = ["run"]
