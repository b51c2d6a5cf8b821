"""What a team is told: who belongs to it, how it stands, where it goes and how fast. Part of a scenario.

A `Mission` reaches an agent over Zenoh (topic `mission`) or from `--mission FILE`. Field names carry their
units; a value that no robot could obey is refused with one line that names the field.
"""

from __future__ import annotations

from math import pi
from typing import Literal

from msgspec import Struct

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
