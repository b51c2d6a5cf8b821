"""`lfa set`: changes speed, motion or formation of a running fleet, within the limits of its mission."""

from __future__ import annotations

from math import isfinite, nan
from typing import Annotated, get_args

import msgspec
import typer
from msgspec import structs

from lfa.deploy.client.mission_changes import unchanged
from lfa.deploy.client.order_call import Change
from lfa.deploy.operate import pause
from lfa.deploy.operate.options import AsJson, Connect, FleetName, Keys
from lfa.protocol.errors import Refused
from lfa.protocol.mission import FormationSpec, Leading, Mission, Motion, Side
from lfa.protocol.mission_checks import check_mission

IN_LEADING = ("motion", "cruise_mps", "acceleration_mps2", "goal_tolerance_m", "waypoint_tolerance_m")
IN_FORMATION = ("separation_m", "angle_rad", "side")
CHOICES: dict[str, tuple[str, ...]] = {"motion": get_args(Motion), "side": get_args(Side)}
"""Values that are words; all others are numbers."""
Value = str | float


def command(
    values: Annotated[list[str], typer.Argument(help="Changes as key=value, such as cruise_mps=0.3 side=column.")],
    fleet: FleetName = None,
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> int:
    """Change the mission's values; return 0 if a leader has acknowledged it, else 1. Raises Refused."""
    change = to_values(values)
    return pause.say(f"set {' '.join(values)}", lambda subscriber: change, fleet, connect, keys, as_json)


def to_values(values: list[str]) -> Change:
    """Return the change to these values, each `key=value`. Raises Refused for a key that cannot change."""
    pairs: dict[str, Value] = {}
    for value in values:
        key, wanted = _pair(value)
        if key in pairs:
            raise Refused(f"set {value}: {key} is given twice, must be given once")
        pairs[key] = wanted

    def change(mission: Mission, _first: Mission) -> Mission:
        leading = {**msgspec.to_builtins(mission.leading), **_part(pairs, IN_LEADING)}
        formation = {**msgspec.to_builtins(mission.formation), **_part(pairs, IN_FORMATION)}
        changed = structs.replace(
            mission,
            leading=msgspec.convert(leading, Leading),
            formation=msgspec.convert(formation, FormationSpec),
        )
        return check_mission(changed)

    return change if pairs else unchanged


def _pair(value: str) -> tuple[str, Value]:
    key, equals, text = value.partition("=")
    key = key.removeprefix("mission.").removeprefix("leading.").removeprefix("formation.")
    if not equals or key not in (*IN_LEADING, *IN_FORMATION):
        raise Refused(f"set {value}: must be key=value with one of {', '.join((*IN_LEADING, *IN_FORMATION))}")
    if key in CHOICES and text not in CHOICES[key]:
        raise Refused(f"set {value}: must be one of {', '.join(CHOICES[key])}")
    if key in CHOICES:
        return key, text
    number = _number(text)
    if not isfinite(number):
        raise Refused(f"set {value}: must be a number")
    return key, number


def _number(text: str) -> float:
    """Return the number in `text`, nan if it is none: what Python reads (`.5`, `+1`), and a mission's file may not."""
    try:
        return float(text)
    except ValueError:
        return nan


def _part(pairs: dict[str, Value], keys: tuple[str, ...]) -> dict[str, Value]:
    return {key: text for key, text in pairs.items() if key in keys}
