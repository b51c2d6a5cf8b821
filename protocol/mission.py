"""What a team is told: who belongs to it, how it stands, where it goes and how fast. Part of a scenario.

A `Mission` reaches an agent over Zenoh (topic `mission`) or from `--mission FILE`. Field names carry their
units; a value that no robot could obey is refused with one line that names the field.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from math import hypot, inf, isfinite, pi
from typing import Literal

from msgspec import Struct

WITNESS_ID = 0
WITNESS_NAME = "witness"
DIGITS_MAX = 18
KNOWN_MAX = 64
"""Known obstacles that a leader plans past: each costs planning time."""
ROUTE_M_MAX = 10_000.0
"""A leader keeps its route as a point each 0.1 m: a longer one takes the memory of the robot, then of the machine."""

Side = Literal["left", "right", "column", "zigzag"]
Motion = Literal["path_following", "point_to_point", "trajectory", "reactive", "explore"]
TieBreak = Literal["witness", "head", "none"]
ColdStart = Literal["full_house", "majority"]
Shrink = Literal["dynamic", "static"]
Lonely = Literal["stop", "continue_after"]
Profile = Literal["fast", "std", "wifi"]


class Refused(ValueError):
    """A value given by a person that cannot be obeyed; the text is one line: what, where, what would be right."""


class FormationSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """Where each follower stands behind its predecessor (control.md section 4)."""

    separation_m: float = 1.2
    """k^d, the distance to the predecessor."""
    angle_rad: float = pi / 3
    """alpha, the angle off the predecessor's rear axis, in [0, pi/2]; the paper's phi."""
    side: Side = "left"
    heading_filter_m: float = 0.0
    """L_chi: the travelled distance over which the formation's heading follows the predecessor's."""


class Following(Struct, frozen=True, forbid_unknown_fields=True):
    """How a follower keeps its place (control.md sections 2, 3 and 5)."""

    controller: str = "law"
    """An installed one: `law`, `kanayama`, `headway`, or anybody's own (entry points `lfa.controllers`)."""
    observer: Literal["velocity", "pose", "paper"] = "velocity"
    """What is used of the predecessor's messages: pose and velocity, pose only, or pose only by the paper's matrix."""
    trace: bool = False
    """Follow the predecessor's path instead of standing at an offset to it."""
    delay_s: float | None = None
    """Look at the predecessor so long ago. None: 0 for up to 3 followers, else as old as messages get."""
    gains: dict[str, float] = {}
    """Other than the default, by their names in `agents/config.py`."""
    allow_saturation: bool = False
    """Accept gains that ask for more acceleration than the drive has: for simulation only."""


class Limits(Struct, frozen=True, forbid_unknown_fields=True):
    """What a robot's drive can do; the follower law keeps v/omega when it saturates."""

    v_max_mps: float = 1.0
    v_reverse_max_mps: float = 0.3
    omega_max_radps: float = 2.0
    a_max_mps2: float = 1.0
    alpha_max_radps2: float = 4.0
    bridge_gap_m: float = 0.05
    """The widest hole that its wheels bridge, however deep."""
    climb_step_m: float = 0.010
    """The highest step that they climb."""


class Orientation(Struct, frozen=True, forbid_unknown_fields=True):
    """A change of formation that the leader asks for when it has come so far along the route."""

    at_m: float
    side: Side


class Leading(Struct, frozen=True, forbid_unknown_fields=True):
    """How a leader drives."""

    motion: Motion = "path_following"
    """Along the way-points; straight to the goal and back to that line after a detour (`point_to_point`); along the
    way-points by `times_s` (`trajectory`); wherever is free towards the goal, with no line to go back to (`reactive`);
    or on a route of its own through ground that it maps (`explore`)."""
    route_m: tuple[tuple[float, float], ...] = ()
    """Way-points in `map`; the last is the goal."""
    times_s: tuple[float, ...] = ()
    """With `trajectory`: when each way-point is due, the first at 0. A new leader goes on from where it stands."""
    cruise_mps: float = 0.5
    acceleration_mps2: float = 0.5
    goal_tolerance_m: float = 0.10
    orientations: tuple[Orientation, ...] = ()
    """In the order of the route."""
    keepout_m: tuple[tuple[float, float, float, float], ...] = ()
    """Boxes x1, y1, x2, y2 in `map` that `explore` plans no route through."""
    known_m: tuple[tuple[float, float, float], ...] = ()
    """Circles x, y, radius in `map`: what an earlier run met, and a route along way-points is led past."""


class Mission(Struct, frozen=True, forbid_unknown_fields=True):
    """Everything that a team is told. `version` grows with each change; a higher one replaces a lower."""

    robots: tuple[int, ...] = (1, 2, 3, 4)
    """Ids in the order of the first chain; the first leads."""
    witness: bool = True
    profile: Profile = "std"
    tiebreak: TieBreak = "witness"
    """Who decides between two halves: the witness, the head of the chain, or nobody."""
    shrink: Shrink = "dynamic"
    """`static`: never fewer voters than a majority of the team."""
    cold_start: ColdStart = "full_house"
    """Who must be there when nobody remembers anything: all ids, or after 3 s more than half of them with the witness.

    `majority` is for gateways that stand or fall with the witness, as a simulated world's do (E19).
    """
    lonely: Lonely = "stop"
    """What those without a quorum do: stop, or go on by themselves after `continue_after_s` without a leader.

    `continue_after` gives safety up for motion where a team is parted; it is for gateways of one world (E21).
    """
    continue_after_s: float = 10.0
    can_lead: tuple[int, ...] | None = None
    """Ids that may lead; all when not given."""
    formation: FormationSpec = FormationSpec()
    following: Following = Following()
    leading: Leading = Leading()
    limits: Limits = Limits()
    radius_m: float = 0.15
    version: int = 1

    @property
    def goal_m(self) -> tuple[float, float]:
        return self.leading.route_m[-1]

    def may_lead(self, robot_id: int) -> bool:
        return self.can_lead is None or robot_id in self.can_lead


def robot_name(robot_id: int) -> str:
    """The name of an id in keys and messages: `robot2`, or `witness` for the voter without a robot."""
    return WITNESS_NAME if robot_id == WITNESS_ID else f"robot{robot_id}"


@lru_cache(maxsize=1024)  # asked for each message; bounded: strangers may call themselves anything
def robot_id_of(name: str) -> int | None:
    """The id behind a name, None when it names no robot and no witness."""
    if name == WITNESS_NAME:
        return WITNESS_ID
    digits = name.removeprefix("robot")
    return whole_number(digits) if name.startswith("robot") and not digits.startswith("0") else None


def whole_number(text: str) -> int | None:
    """What `text` says in digits, so few of them that messages and journals can hold it; None when it is no such."""
    return int(text) if len(text) <= DIGITS_MAX and text.isascii() and text.isdecimal() else None


def check_mission(mission: Mission) -> Mission:
    """`mission`, or `Refused` with the first field that cannot be obeyed."""
    ids = mission.robots
    repeated = next((i for n, i in enumerate(ids) if i in ids[:n]), None)
    _require(len(ids) >= 1, "mission.robots", list(ids), "at least one robot id")
    _require(all(i >= 1 for i in ids), "mission.robots", list(ids), "ids from 1 upwards")
    _require(repeated is None, "mission.robots", list(ids), f"each id once (id {repeated} is given twice)")
    if mission.can_lead is not None:
        known = [i for i in mission.can_lead if i in ids]
        right = "a non-empty part of mission.robots"
        _require(bool(known) and len(known) == len(mission.can_lead), "mission.can_lead", mission.can_lead, right)
    for name, value, low, high in _ranges(mission):
        fine = isfinite(value) and low <= value <= high
        _require(
            fine,
            f"mission.{name}",
            value,
            f"a number from {low:g} to {high:g}" if high < inf else f">= {low:g}",
        )
    _require(len(mission.leading.route_m) >= 1, "mission.leading.route_m", "[]", "at least one way-point [x, y]")
    _check_times(mission.leading)
    _check_known(mission.leading)
    for box in mission.leading.keepout_m:
        fine = all(map(isfinite, box)) and box[0] < box[2] and box[1] < box[3]
        _require(fine, "mission.leading.keepout_m", list(box), "x1, y1, x2, y2 [m] with x1 < x2 and y1 < y2")
    for orientation in mission.leading.orientations:
        fine = isfinite(orientation.at_m) and orientation.at_m >= 0.0
        _require(fine, "mission.leading.orientations.at_m", orientation.at_m, ">= 0, metres along the route")
    _check_route(mission.leading.route_m)
    return mission


def _check_route(points: tuple[tuple[float, float], ...]) -> None:
    """Way-points near enough that the way along them can be kept in memory."""
    where = "mission.leading.route_m"
    for point in points:
        near = all(isfinite(c) and abs(c) <= ROUTE_M_MAX for c in point)
        _require(near, where, list(point), f"coordinates [m] from {-ROUTE_M_MAX:g} to {ROUTE_M_MAX:g}")
    length_m = sum(hypot(q[0] - p[0], q[1] - p[1]) for p, q in pairwise(points))
    _require(length_m <= ROUTE_M_MAX, where, f"{length_m:.0f} m of way", f"at most {ROUTE_M_MAX:g} m")


def _check_known(leading: Leading) -> None:
    """Known obstacles are circles, and only a route along way-points is led past them."""
    where, followed = "mission.leading.known_m", leading.motion == "path_following"
    value = [list(circle) for circle in leading.known_m]
    _require(followed or not value, where, value, 'left out without motion = "path_following"')
    _require(len(value) <= KNOWN_MAX, where, f"{len(value)} circles", f"at most {KNOWN_MAX}")
    for circle in leading.known_m:
        fine = all(map(isfinite, circle)) and 0.0 < circle[2] <= 100.0
        _require(fine, where, list(circle), "x, y, radius [m], the radius above 0 and at most 100")


def _check_times(leading: Leading) -> None:
    """A trajectory has a time for each way-point, and no leg that needs more than `cruise_mps`."""
    times, points, where = leading.times_s, leading.route_m, "mission.leading.times_s"
    if leading.motion != "trajectory":
        _require(not times, where, list(times), 'left out without motion = "trajectory"')
        return
    _require(len(times) == len(points) >= 2, where, list(times), f"a time for each of the {len(points)} way-points")
    rising = all(isfinite(b) and a < b for a, b in pairwise(times)) and times[0] == 0.0
    _require(rising, where, list(times), "rising from 0")
    for (a, b), (p, q) in zip(pairwise(times), pairwise(points), strict=True):
        needed_mps = hypot(q[0] - p[0], q[1] - p[1]) / (b - a)
        right = f"later: this leg needs {needed_mps:.2f} m/s, more than cruise_mps = {leading.cruise_mps:g}"
        _require(needed_mps <= leading.cruise_mps, where, b, right)


def _ranges(mission: Mission) -> list[tuple[str, float, float, float]]:
    formation, limits, leading = mission.formation, mission.limits, mission.leading
    return [
        ("radius_m", mission.radius_m, 0.01, 5.0),
        ("formation.separation_m", formation.separation_m, 2.0 * mission.radius_m + 0.1, 100.0),
        ("formation.angle_rad", formation.angle_rad, 0.0, pi / 2),
        ("formation.heading_filter_m", formation.heading_filter_m, 0.0, 100.0),
        ("continue_after_s", mission.continue_after_s, 2.0, 3600.0),
        ("following.delay_s", mission.following.delay_s or 0.0, 0.0, 0.8),
        ("limits.v_max_mps", limits.v_max_mps, 0.01, inf),
        ("limits.v_reverse_max_mps", limits.v_reverse_max_mps, 0.0, inf),
        ("limits.omega_max_radps", limits.omega_max_radps, 0.01, inf),
        ("limits.a_max_mps2", limits.a_max_mps2, 0.01, inf),
        ("limits.alpha_max_radps2", limits.alpha_max_radps2, 0.01, inf),
        ("limits.bridge_gap_m", limits.bridge_gap_m, 0.0, 10.0),
        ("limits.climb_step_m", limits.climb_step_m, 0.0, 10.0),
        ("leading.cruise_mps", leading.cruise_mps, 0.01, limits.v_max_mps),
        ("leading.acceleration_mps2", leading.acceleration_mps2, 0.01, limits.a_max_mps2),
        ("leading.goal_tolerance_m", leading.goal_tolerance_m, 0.01, 10.0),
    ]


def _require(fine: bool, where: str, value: object, right: str) -> None:
    if not fine:
        raise Refused(f"{where} = {value}: must be {right}")
