"""Messages between robots, and from robots to operators."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any

from msgspec import UNSET, Meta, Struct
from msgspec.structs import replace

from lfa.protocol.geometry import Number, Pose2D, Twist
from lfa.protocol.messages.consensus import Role, Term
from lfa.protocol.messages.header import Count, Header, Stamp
from lfa.protocol.mission import FOOTPRINT_CORNERS_MAX, Mission


class PoseStamped(Struct, frozen=True, array_like=True, tag="pose"):
    """A robot's own pose in `map` at `header.stamp` on its clock; only its successor subscribes to it."""

    header: Header
    x: Number
    y: Number
    z: Number
    theta: Number
    twist: Twist
    odometer_m: Number
    role: Role
    term: Term


class Delay(Struct, frozen=True, array_like=True, gc=False):
    """Minimum (receive - send) [s] measured for a peer: one half of a round trip, for the clock offset."""

    robot: Count
    least_s: Stamp


class RouteProgress(Struct, frozen=True, array_like=True, gc=False):
    """Progress of a team along its mission's way-points, which all of its robots know."""

    waypoint: Count
    """Index of the next way-point; the number of way-points once the team has arrived."""
    to_m: Number
    """Distance [m] to it, along the route where there is one."""
    route: Count = 0
    """Version of the order that gave this route (E32); 0: the mission's own."""


class TableRow(Struct, frozen=True, array_like=True, tag="table"):
    """One robot's row of the paper's table (X, Y, Z, theta), which every robot keeps of all robots."""

    header: Header
    x: Number
    y: Number
    z: Number
    theta: Number
    odometer_m: Number
    role: Role
    delays: tuple[Delay, ...] = ()
    stuck: bool = False
    progress: RouteProgress | None = None
    """Progress of the team: of a leader its own, of another robot the leader's as last heard; None: never heard."""
    placed: bool = True
    """False: the robot has no pose; x, y and theta mean nothing then."""


class Tracking(Struct, frozen=True, array_like=True, tag="tracking"):
    """Commanded slot of a follower and its tracking error, for recorder and views."""

    header: Header
    predecessor: int
    separation_m: float
    phi: float
    chi: float
    heading: float
    """Feasible heading psi_r [rad]."""
    slot_map: Pose2D
    error_m: float
    avoiding: bool
    state: str


class Slot(Struct, frozen=True, array_like=True, gc=False):
    """Commanded position of one follower: k^d [m] and phi^d [rad] in its predecessor's formation frame."""

    robot: Count
    separation_m: Number
    phi: Number


class FormationNote(Struct, frozen=True, array_like=True, tag="formation"):
    """Formation request of the leader of `term`; the highest (term, number) counts."""

    header: Header
    term: Term
    number: Count
    slots: tuple[Slot, ...]
    trace: bool = False
    side: str = ""
    """Side of the newest order, by the route or by hand, which the next leader keeps to; empty: none was given."""


class ObstacleNote(Struct, frozen=True, array_like=True, tag="obstacles"):
    """Obstacle that one robot met or tracks, shared with all robots; position [m] in `map`."""

    header: Header
    kind: str
    x: Number
    y: Number
    radius_m: Number
    twist_map: tuple[Number, Number] = (0.0, 0.0)


class PlanNote(Struct, frozen=True, array_like=True, tag="plan"):
    """Route and one map tile of a leader that explores unknown ground, for recorder and views."""

    header: Header
    route_map: tuple[tuple[Number, Number], ...]
    """Route points x, y [m] in `map`."""
    cell_m: Number
    corner_map: tuple[Number, Number]
    """Lower left corner [m] of the tile in `map`."""
    columns: int
    cells: bytes
    """Cells row by row from the lower left: 0 unknown, 1 free, 2 occupied."""


class MissionNote(Struct, frozen=True, array_like=True, tag="mission"):
    """Mission for the robots. Its footprint stands beside it, where the version before skips it (E35)."""

    header: Header
    mission: Mission
    footprint_m: Annotated[tuple[tuple[Number, Number], ...], Meta(max_length=FOOTPRINT_CORNERS_MAX)] = ()

    @classmethod
    def of(cls, header: Header, mission: Mission) -> MissionNote:
        """Return the note that tells `mission`."""
        return cls(header, replace(mission, footprint_m=UNSET), mission.footprint_m or ())

    @property
    def whole(self) -> Mission:
        """Return the mission with the footprint."""
        return replace(self.mission, footprint_m=self.footprint_m) if self.footprint_m else self.mission


class Ask(Struct, frozen=True, array_like=True, tag="ask"):
    """Request to publish the last message of the topic `what` again."""

    header: Header
    what: str


class OperatorNote(Struct, frozen=True, array_like=True, tag="operator"):
    header: Header
    command: str
    arguments: dict[str, Any] = {}


class Level(StrEnum):
    OK = "OK"
    WARN = "WARN"
    ERROR = "ERROR"
    STALE = "STALE"


REFUSED_OF = "refused_of_"
"""Prefix of the counters of a `Status` that say how much of which member its sender refused, since its start."""


class Status(Struct, frozen=True, array_like=True, tag="status"):
    """Diagnostics as in ROS: a level, a sentence, and counters."""

    header: Header
    level: Level
    text: str
    role: Role
    term: Term
    counters: dict[str, float]
    chain: tuple[int, ...] = ()
    """Chain that the robot follows, leader first: an observer that missed the event `chain` learns it here."""


class Event(Struct, frozen=True, array_like=True, tag="event"):
    """Entry of `events.jsonl`: a decision, a change of role, a lease event, a contact or a fault."""

    header: Header
    kind: str
    term: Term | None
    data: dict[str, Any]
