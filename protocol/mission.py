"""The mission of a team: its members, formation, route and speeds. Part of a scenario.

A `Mission` reaches an agent over Zenoh (topic `mission`) or from `--mission FILE`. Field names carry their
units; `mission_checks.py` rejects an infeasible value with one line that names the field.
"""

from __future__ import annotations

from math import pi
from typing import Literal

from msgspec import UNSET, Struct, UnsetType

from lfa.protocol.geometry import Point

KNOWN_MAX = 64
"""Maximum number of known obstacles that a leader plans around: each costs planning time."""
ROUTE_M_MAX = 10_000.0
"""Maximum route length [m]: a leader stores one point per 0.1 m, so that a longer route would exhaust the memory."""

FOOTPRINT_CORNERS_MAX = 32
"""Largest number of corners of a body: each costs time in every control step."""

CONTROL_HZ, CONTROL_HZ_MIN = 50.0, 10.0
"""Usual and least rate [Hz] of the robots' control steps."""

Side = Literal["left", "right", "column", "zigzag"]
Motion = Literal["path_following", "point_to_point", "trajectory", "reactive", "explore"]
TieBreak = Literal["witness", "head", "none"]
ColdStart = Literal["full_house", "majority"]
Shrink = Literal["dynamic", "static"]
Lonely = Literal["stop", "continue_after"]
Profile = Literal["fast", "std", "wifi", "auto"]
Parameter = bool | float | str | tuple[float, ...]
"""Value of a plug-in's own parameter."""


class FormationSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """Slot of each follower relative to its predecessor (control.md section 4)."""

    separation_m: float = 1.2
    """Distance k^d [m] to the predecessor."""
    angle_rad: float = pi / 3
    """Angle alpha [rad] off the predecessor's rear axis, in [0, pi/2]; the paper's phi."""
    side: Side = "left"
    heading_filter_m: float = 0.0
    """Travelled distance L_chi [m] over which the formation's heading follows the predecessor's. 0: none, the paper's
    rigid offset, with up to 3 followers and on a trace; 0.6 k |cos phi| with more, whose rigid slots would swing."""


class Following(Struct, frozen=True, forbid_unknown_fields=True):
    """Control of a follower in its slot (control.md sections 2, 3 and 5)."""

    controller: str = "law"
    """Name of an installed controller: `law`, `kanayama`, `headway` or a custom one (entry point `lfa.controllers`)."""
    parameters: dict[str, Parameter] = {}
    """Parameters of the controller itself, by the names and types that its class gives in `Parameters`."""
    observer: Literal["velocity", "pose", "paper"] = "velocity"
    """Input from the predecessor's messages: pose and velocity, pose only, or pose only (the paper's matrix)."""
    trace: bool = False
    """Follow the predecessor's path instead of keeping an offset to its pose."""
    delay_s: float | None = None
    """Age [s] at which the predecessor's state is used. None: 0 for up to 3 followers, else the worst message age."""
    gains: dict[str, float] = {}
    """Gains that differ from the default, by their names in `agents/config.py`."""
    allow_saturation: bool = False
    """Accept gains that demand more acceleration than the drive has; for simulation only."""


class Limits(Struct, frozen=True, forbid_unknown_fields=True):
    """Limits of a robot's drive; the follower law keeps the ratio v/omega when it saturates."""

    v_max_mps: float = 1.0
    v_reverse_max_mps: float = 0.3
    omega_max_radps: float = 2.0
    a_max_mps2: float = 1.0
    alpha_max_radps2: float = 4.0
    bridge_gap_m: float = 0.05
    """Width [m] of the widest hole that the wheels bridge, whatever its depth."""
    climb_step_m: float = 0.010
    """Height [m] of the highest step that the wheels climb."""


class Orientation(Struct, frozen=True, forbid_unknown_fields=True):
    """Change of formation that the leader requests at `at_m` metres along the route."""

    at_m: float
    side: Side


class Leading(Struct, frozen=True, forbid_unknown_fields=True):
    """Motion of the leader."""

    motion: Motion = "path_following"
    """Motion mode: along the way-points (`path_following`); straight to the goal, returning to that line after a detour
    (`point_to_point`); along the way-points by `times_s` (`trajectory`); through free space towards the goal, without a
    line to return to (`reactive`); or on a self-planned route through ground that it maps (`explore`)."""
    route_m: tuple[tuple[float, float], ...] = ()
    """Way-points (x, y) [m] in `map`; the last is the goal."""
    times_s: tuple[float, ...] = ()
    """Due time [s] of each way-point with `trajectory`, the first 0. A new leader continues from its own position."""
    cruise_mps: float = 0.5
    acceleration_mps2: float = 0.5
    goal_tolerance_m: float = 0.10
    """Distance [m] to the last way-point within which the leader comes to rest. With something on it, the leader ends
    at the nearest free place within 1 m of it; the run fails if there is none."""
    waypoint_tolerance_m: float = 0.15
    """Distance [m] within which the leader passes each way-point on the way to the last: it rounds a corner so far, and
    turns on the spot in a sharp one. With something on a way-point, it passes the nearest free place."""
    corner_radius_m: float | None = None
    """Radius [m] by which the route rounds its corners, whatever their distance to the way-points. None: by
    `waypoint_tolerance_m`."""
    orientations: tuple[Orientation, ...] = ()
    """Changes of formation, in the order of the route."""
    keepout_m: tuple[tuple[float, float, float, float], ...] = ()
    """Boxes x1, y1, x2, y2 [m] in `map` that `explore` plans no route through."""
    known_m: tuple[tuple[float, float, float], ...] = ()
    """Obstacles met by an earlier run, as circles x, y, radius [m] in `map`; a way-point route is led around them."""


class Mission(Struct, frozen=True, forbid_unknown_fields=True):
    """Complete order to a team. `version` grows with each change; a mission of higher version replaces a lower one."""

    robots: tuple[int, ...] = (1, 2, 3, 4)
    """Ids in the order of the first chain; the first leads."""
    witness: bool = True
    profile: Profile = "std"
    """Durations of the lease: fixed ones (`fast`, `std`; `wifi` for radio), or such that follow how late processes and
    links are (`auto`, for busy machines)."""
    control_hz: float = CONTROL_HZ
    """Rate [Hz] of each robot's control steps, with its commands and poses, and of a simulated robot's odometry. A
    lower rate lets a machine run more robots; the deadman D, and the age at which odometry is too old to drive by, are
    never shorter than three control periods (300 ms at 10 Hz)."""
    tiebreak: TieBreak = "witness"
    """Tie-breaker between two halves of the voters: the witness, the head of the chain, or none."""
    shrink: Shrink = "dynamic"
    """Removal of voters. `static`: always keep at least a majority of the team as voters."""
    cold_start: ColdStart = "full_house"
    """Ids required for a start when no process remembers a config: all ids, or (`majority`) after 3 s more than half of
    them, the witness included.

    `majority` is for gateways that fail together with the witness, as those of a simulated world do (E19).
    """
    lonely: Lonely = "stop"
    """Behaviour on quorum loss: stop, or continue without a quorum after `continue_after_s` without a leader.

    `continue_after` trades safety for motion while a team is partitioned; it is for gateways of one world (E21).
    """
    continue_after_s: float = 10.0
    can_lead: tuple[int, ...] | None = None
    """Ids that may lead; None: all."""
    formation: FormationSpec = FormationSpec()
    following: Following = Following()
    leading: Leading = Leading()
    behaviors: tuple[str, ...] = ()
    """Names of behaviours of one's own (entry point `lfa.behaviors`), in the order in which they act: each may want
    another twist than the robot's role gives."""
    limits: Limits = Limits()
    radius_m: float = 0.15
    """Radius [m] of the circle around `base_link` that holds the body, and that the robots keep free."""
    operator_timeout_s: float | None = None
    """Silence [s] of all operators after which every robot stands, until one is there again; `lfa watch` shows that one
    is. None: a team needs no operator."""
    version: int = 1
    footprint_m: tuple[Point, ...] | UnsetType = UNSET
    """Corners x, y [m] of a body that is a convex polygon within the circle of `radius_m`, in `base_link`,
    counter-clockwise around its origin: such a robot passes wherever the polygon does. Not given: it is round."""

    @property
    def control_period_s(self) -> float:
        """Time [s] between two control steps of a robot."""
        return 1.0 / self.control_hz

    @property
    def half_width_m(self) -> float:
        """Half of the width [m] of the body: what it needs to either side of a straight way."""
        return max(abs(y) for _, y in self.footprint_m) if self.footprint_m else self.radius_m

    @property
    def goal_m(self) -> tuple[float, float]:
        return self.leading.route_m[-1]

    def may_lead(self, robot_id: int) -> bool:
        return self.can_lead is None or robot_id in self.can_lead
