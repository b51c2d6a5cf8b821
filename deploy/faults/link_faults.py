"""Parsing of the faults that an operator's message orders: links that a cut disables, the share of messages that is
lost, the reach of the radio, the part of a robot that hangs, a formation, an obstacle, a goal. Sides are
comma-separated ids; `w` is the world with its witness, which runs on no robot.

    3       robot 3 from all others          1-2      1 and 2 from each other
    1,2     both of them from the rest       1,2-3,w  one side from the other
    1>2     2 does not receive from 1
"""

from __future__ import annotations

import re
from math import isfinite
from typing import Any, get_args

from lfa.deploy.client.operator import Operator
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Side
from lfa.protocol.names import robot_name, whole_number
from lfa.protocol.node import Envelope
from lfa.protocol.topics import WORLD_NAME
from lfa.protocol.transport.link_model import LINK_CONDITIONS, Link
from lfa.world.description.scenario import PLACE_M_MAX, RADIUS_M_MAX, RADIUS_M_MIN, Point

WORLD_WORD = "w"
RANGE_M_MAX = 1e4
PART = re.compile(r"(?P<part>driver|localization|scanner) *(?P<robot>\d+)", re.ASCII)
SIDES = re.compile(r"(?P<one>[\dw,]+)(?:(?P<way>[->])(?P<other>[\dw,]+))?", re.ASCII)


def links(text: str, robots: tuple[int, ...]) -> tuple[Link, ...]:
    """Return the directed links that the cut `text` disables in a team of `robots`. Raises Refused."""
    match = SIDES.fullmatch(text)
    right = f"such as 3, 1-2, 1,2-3,w or 1>2, of ids {', '.join(map(str, robots))} and w for the world"
    if match is None:
        raise Refused(f"cut {text!r}: must be {right}")
    one = _side(match["one"], robots, right)
    everybody = [*(robot_name(robot) for robot in robots), WORLD_NAME]
    rest = [place for place in everybody if place not in one]
    other = rest if match["other"] is None else _side(match["other"], robots, right)
    if set(one) & set(other):
        raise Refused(f"cut {text!r}: nobody may be on both sides")
    there = tuple((a, b) for a in one for b in other)
    return there if match["way"] == ">" else there + tuple((b, a) for a, b in there)


def _side(text: str, robots: tuple[int, ...], right: str) -> list[str]:
    words = text.split(",")
    if not all(word == WORLD_WORD or (whole_number(word) in robots) for word in words):
        raise Refused(f"cut side {text!r}: must be {right}")
    return [WORLD_NAME if word == WORLD_WORD else robot_name(int(word)) for word in words]


def order(action: str, target: int | str, robots: tuple[int, ...]) -> tuple[str, dict[str, Any]]:
    """Return the operator's command and its arguments for each of `script.ORDERS`.

    Raises Refused.
    """
    text = str(target)
    match action:
        case "cut":
            return LINK_CONDITIONS, {"cut": links(text, robots)}
        case "heal":
            return LINK_CONDITIONS, {"mend": links(text, robots)} if text else {"heal": True}
        case "loss":
            return LINK_CONDITIONS, {"radio": {"loss": _share(text)}} if text else {"fair": True}
        case "range":
            return LINK_CONDITIONS, {"radio": {"range_m": _range_m(text)}}
        case "hang" | "resume":
            return action, _part(action, text, robots)
        case "formation":
            return action, {"side": _side_of_team(text)}
        case "obstacle":
            return action, _obstacle(text)
        case "goal":
            return action, dict(zip("xy", goal_of(text), strict=True))
        case _:
            return action, {}


def note(operator: Operator, now: float, action: str, target: int | str, robots: tuple[int, ...]) -> Envelope:
    """Return the operator's message for a fault, stamped `now` [s]. Raises Refused."""
    command, arguments = order(action, target, robots)
    return operator.command(command, now, **arguments)


def goal_of(text: str) -> Point:
    """Return the goal x, y [m] in `text`. Raises Refused."""
    x, y = _numbers(text, 2) or (PLACE_M_MAX + 1.0, 0.0)
    if max(abs(x), abs(y)) > PLACE_M_MAX:
        raise Refused(f"goal {text!r}: must be x and y [m] from -{PLACE_M_MAX:g} to {PLACE_M_MAX:g}, such as 3,-1.5")
    return x, y


def _part(action: str, text: str, robots: tuple[int, ...]) -> dict[str, Any]:
    match = PART.fullmatch(text)
    robot = None if match is None else whole_number(match["robot"])
    if match is None or robot not in robots:
        ids = ", ".join(map(str, robots))
        raise Refused(
            f"{action} {text!r}: must be driver, localization or scanner of a robot of {ids}, such as driver 2"
        )
    return {"part": match["part"], "robot": robot}


def _range_m(text: str) -> float:
    (metres,) = _numbers(text, 1) or (-1.0,)
    if not 0.0 <= metres <= RANGE_M_MAX:
        raise Refused(f"range {text!r}: must be metres from 0 (no limit) to {RANGE_M_MAX:g}, such as 5")
    return metres


def _side_of_team(text: str) -> str:
    if text not in get_args(Side):
        raise Refused(f"formation {text!r}: must be one of {', '.join(get_args(Side))}")
    return text


def _obstacle(text: str) -> dict[str, Any]:
    x, y, radius_m = _numbers(text, 3) or (0.0, 0.0, -1.0)
    if not (abs(x) <= PLACE_M_MAX and abs(y) <= PLACE_M_MAX and RADIUS_M_MIN <= radius_m <= RADIUS_M_MAX):
        sizes = f"a radius from {RADIUS_M_MIN:g} to {RADIUS_M_MAX:g} m"
        raise Refused(f"obstacle {text!r}: must be x, y and {sizes}, such as 5,1.5,0.3")
    return {"x": x, "y": y, "radius_m": radius_m}


def _numbers(text: str, count: int) -> tuple[float, ...] | None:
    """Return the comma-separated finite numbers in `text`, or None if there are not `count` of them."""
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        return None
    return numbers if len(numbers) == count and all(map(isfinite, numbers)) else None


def _share(text: str) -> float:
    try:
        share = float(text)
    except ValueError:
        share = -1.0
    if not 0.0 <= share <= 1.0:
        raise Refused(f"loss {text!r}: must be a share from 0 to 1, such as 0.2")
    return share
