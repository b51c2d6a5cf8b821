"""Faults that a scenario cannot have: goals where no leader can get, and what only robots with a scanner are dealt."""

from __future__ import annotations

from collections.abc import Iterable

from lfa.deploy.faults.goals import check_goal
from lfa.deploy.faults.link_faults import goal_of
from lfa.deploy.faults.script import GOAL, Fault
from lfa.protocol.errors import Refused
from lfa.world.description.scenario import Scenario


def check_faults(scenario: Scenario, faults: Iterable[Fault]) -> None:
    """Raise Refused for a goal in or behind a wall or on an obstacle, and, for robots without a scanner, for one that
    hangs and for an obstacle that nobody would see.
    """
    for fault in faults:
        if fault.action == GOAL:
            check_goal(scenario, goal_of(str(fault.target)))
        elif not scenario.world.lidar.fitted and (fault.action == "obstacle" or _is_of_scanner(fault)):
            raise Refused(
                f"{fault.action} {fault.target}: must be left out for robots without a scanner (world.lidar.beams = 0)"
            )


def _is_of_scanner(fault: Fault) -> bool:
    return fault.action in ("hang", "resume") and str(fault.target).startswith("scanner")
