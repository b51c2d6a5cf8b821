"""`lfa bench router`: what one router carries, and what a message through it costs."""

from lfa.deploy.bench.router.measure import run

__all__ = ["run"]
