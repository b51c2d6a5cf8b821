"""`lfa bench web`: how soon the page shows, how smoothly it draws, what a viewer costs, how soon a click kills."""

from lfa.deploy.bench.web.page import run

__all__ = ["run"]
