"""Decision table of control.md section 7 as data: obstacle class, condition, action, updated quantity.

Rows are tried in order and the first whose condition holds is taken. An obstacle strategy updates speed and position,
an environment strategy the angle; both end in a new trajectory (the paper's section 3.2).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from math import inf
from typing import Literal

from msgspec import Struct

from lfa.agents.perception.obstacle import Class

Updates = Literal["speed and position", "angle"]


class Action(StrEnum):
    """Action of a decision: a row of the table names one, and a behaviour carries it out."""

    CONTINUE = "continue"
    GIVE_WAY = "give_way"
    ASIDE = "aside"
    """Past the obstacle, at the side that is open: `LEFT` or `RIGHT`."""
    LEFT = "left"
    RIGHT = "right"
    U_TURN = "u_turn"
    BACK = "back"
    MAKE_ROOM = "make_room"
    """Back along the own trail, for a team-mate that has to pass."""
    CREEP = "creep"
    BLOCKED = "blocked"
    PLAN_ROUND = "plan_round"
    """Along a way that is planned on a map."""
    SLOW = "slow"
    WAIT = "wait"
    AHEAD = "ahead"
    OVERCOME = "overcome"
    CLIMB = "climb"


class Situation(Struct, frozen=True):
    """Values that a decision is based on."""

    kind: Class
    range_m: float
    """Free distance rho [m] in the direction of travel."""
    width_m: float = 0.0
    """Visible width [m] of the obstacle; inf when its end is out of sight."""
    left_m: float = inf
    right_m: float = inf
    rear_m: float = inf
    back_m: float = inf
    """Free distance [m] straight backwards."""
    closest_m: float = inf
    """Predicted closest approach [m] of a moving obstacle."""
    crept: bool = False
    """True when creeping towards the obstacle has used up its time."""
    crossable: bool = False
    """True when the wheels can bridge or climb it."""
    room_m: float = 0.5
    """Width W_r [m] that the robot needs beside the obstacle."""
    swing_m: float = 0.2
    """Radius r_sw [m] that the robot needs to turn on the spot."""


class DecisionRow(Struct, frozen=True):
    kind: Class
    name: str
    holds: Callable[[Situation], bool]
    action: Action
    updates: Updates


MOTION: Updates = "speed and position"
ANGLE: Updates = "angle"


def _known(s: Situation) -> bool:
    """Return whether the far edge is in sight, so that the width is known."""
    return s.width_m < inf


def _beside(s: Situation) -> bool:
    return max(s.left_m, s.right_m) >= s.room_m


def _behind(s: Situation) -> bool:
    return s.rear_m >= s.swing_m


def _hidden_and_behind(s: Situation) -> bool:
    return not _known(s) and _behind(s)


def _turns(s: Situation) -> bool:
    return s.range_m > s.swing_m


# class, condition, predicate, action, updated quantity
TABLE: tuple[DecisionRow, ...] = (
    DecisionRow("moving", "it keeps its distance", lambda s: s.closest_m >= 0.6, Action.CONTINUE, MOTION),
    DecisionRow("moving", "it comes too near", lambda s: s.closest_m < 0.6, Action.GIVE_WAY, MOTION),
    DecisionRow("wall", "a side is free", lambda s: _turns(s) and _beside(s), Action.ASIDE, ANGLE),
    DecisionRow("wall", "both sides barred", lambda s: _turns(s) and _behind(s), Action.U_TURN, ANGLE),
    DecisionRow("wall", "too near to turn", lambda s: not _turns(s) and s.back_m >= s.swing_m, Action.BACK, ANGLE),
    DecisionRow("ditch", "narrow or shallow enough", lambda s: _known(s) and s.crossable, Action.OVERCOME, ANGLE),
    DecisionRow("ditch", "a side is free", _beside, Action.ASIDE, ANGLE),
    DecisionRow("ditch", "both sides barred", _behind, Action.U_TURN, ANGLE),
    DecisionRow("pothole", "narrow or shallow enough", lambda s: _known(s) and s.crossable, Action.OVERCOME, ANGLE),
    DecisionRow("pothole", "too large, a side is free", lambda s: _known(s) and _beside(s), Action.ASIDE, ANGLE),
    DecisionRow("pothole", "its end is not in sight", _behind, Action.U_TURN, ANGLE),
    DecisionRow("stationary", "a side is free", lambda s: _known(s) and _beside(s), Action.ASIDE, MOTION),
    DecisionRow("stationary", "both sides barred", lambda s: _known(s) and _behind(s), Action.U_TURN, MOTION),
    DecisionRow("stationary", "its end is not in sight", lambda s: not _known(s) and not s.crept, Action.CREEP, MOTION),
    DecisionRow("stationary", "its end stays out of sight", _hidden_and_behind, Action.U_TURN, MOTION),
    DecisionRow("bump", "low enough", lambda s: _known(s) and s.crossable, Action.CLIMB, ANGLE),
    DecisionRow("bump", "too high, a side is free", _beside, Action.ASIDE, ANGLE),
    DecisionRow("bump", "too high, both sides barred", _behind, Action.U_TURN, ANGLE),
)  # fmt: skip


def decide(situation: Situation) -> DecisionRow | None:
    """Return the first row of the situation's class that holds; None when the robot is stuck."""
    return next((row for row in TABLE if row.kind == situation.kind and row.holds(situation)), None)


class Decision(Struct, frozen=True):
    """Present action of a detour, with the values that decided it, for the log."""

    action: Action
    free_m: float
    """Free distance [m] along the wanted motion."""
    bearing: float
    """Chosen direction [rad] in `base_link`."""
    kind: Class = "stationary"
    """Class of the obstacle."""
    condition: str = ""
    """Condition of the chosen row of the decision table; `updates` is what that row updates."""
    updates: str = ""
