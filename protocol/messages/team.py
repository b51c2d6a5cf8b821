"""Messages between robots, and from robots to operators."""

from __future__ import annotations

from enum import StrEnum
from typing import Any

from msgspec import Struct

from lfa.protocol.geometry import Number, Pose2D, Twist
from lfa.protocol.messages.consensus import Role, Term
from lfa.protocol.messages.header import Count, Header, Stamp
from lfa.protocol.mission import Mission


class PoseStamped(Struct, frozen=True, array_like=True, tag="pose"):
    """A robot's own pose in `map`, as of `header.stamp` on its clock; only its successor listens."""

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
    """Least (receive - send) seen from a peer [s]: one half of a round trip, for the clock offset."""

    robot: Count
    least_s: Stamp


class TableRow(Struct, frozen=True, array_like=True, tag="table"):
    """The paper's table (X, Y, Z, theta), kept by all of all."""

    header: Header
    x: Number
    y: Number
    z: Number
    theta: Number
    odometer_m: Number
    role: Role
    delays: tuple[Delay, ...] = ()
    stuck: bool = False


class Tracking(Struct, frozen=True, array_like=True, tag="tracking"):
    """What a follower is commanded to keep and how it stands to it, for recorder and views."""

    header: Header
    predecessor: int
    separation_m: float
    phi: float
    chi: float
    heading: float
    """psi_r, the feasible heading [rad]."""
    slot_map: Pose2D
    error_m: float
    avoiding: bool
    state: str


class Slot(Struct, frozen=True, array_like=True, gc=False):
    """Commanded place of one follower: k^d [m] and phi^d [rad] in its predecessor's formation frame."""

    robot: Count
    separation_m: Number
    phi: Number


class FormationNote(Struct, frozen=True, array_like=True, tag="formation"):
    """The orientation request of the leader of `term`; the highest (term, number) counts."""

    header: Header
    term: Term
    number: Count
    slots: tuple[Slot, ...]
    trace: bool = False


class ObstacleNote(Struct, frozen=True, array_like=True, tag="obstacles"):
    """What one robot met or tracks, shared with all; position in `map`."""

    header: Header
    kind: str
    x: Number
    y: Number
    radius_m: Number
    twist_map: tuple[Number, Number] = (0.0, 0.0)


class PlanNote(Struct, frozen=True, array_like=True, tag="plan"):
    """What who leads through unknown ground knows and intends, for recorder and views: its route, a tile of its map."""

    header: Header
    route_map: tuple[tuple[Number, Number], ...]
    """x, y [m]."""
    cell_m: Number
    corner_map: tuple[Number, Number]
    """The tile's lower left corner [m]."""
    columns: int
    cells: bytes
    """Row by row from the lower left: 0 nobody has looked, 1 free, 2 occupied."""


class MissionNote(Struct, frozen=True, array_like=True, tag="mission"):
    header: Header
    mission: Mission


class Ask(Struct, frozen=True, array_like=True, tag="ask"):
    """`what` names a topic whose last message the sender would like to have again."""

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


class Status(Struct, frozen=True, array_like=True, tag="status"):
    """Diagnostics in the sense of ROS: a level, a sentence, and counters."""

    header: Header
    level: Level
    text: str
    role: Role
    term: Term
    counters: dict[str, float]


class Event(Struct, frozen=True, array_like=True, tag="event"):
    """Something worth a line in `events.jsonl`: a decision, a change of role, a lease event, a contact, a fault."""

    header: Header
    kind: str
    term: Term | None
    data: dict[str, Any]
