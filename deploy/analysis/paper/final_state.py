"""Properties of the end of every run of the paper: goal reached, no contact, no robot left behind."""

from __future__ import annotations

from collections.abc import Sequence

from lfa.deploy.analysis.paper.criteria import Measured
from lfa.deploy.analysis.paper.experiment import Subject


def goal(s: Subject) -> Measured:
    return Measured(float(s.run.summary.outcome == "goal_reached"), s.run.summary.reason or s.run.summary.outcome)


def contacts(s: Subject) -> Measured:
    return Measured(sum(robot.contacts for robot in s.run.summary.robots))


def left_behind(s: Subject) -> Measured:
    return Measured(len(s.run.summary.left_behind), _names(s.run.summary.left_behind))


def _names(robots: Sequence[int]) -> str:
    return ", ".join(f"robot {robot}" for robot in robots)
