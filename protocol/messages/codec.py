"""All that travels between processes, as frozen structs, and the codec (msgpack, one array a message).

Every message begins with a `Header`: Zenoh samples carry no sender, and a stamp of the sender's own monotonic
clock is the only time that means anything. Between machines only differences of stamps do.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from protocol.geometry import NUMBER_MAX, Number, Pose2D, Twist
from protocol.mission import Mission

WIRE_VERSION = 1
MESSAGE_BYTES_MAX = 64 * 1024
Count = Annotated[int, Meta(ge=0, le=2**53)]
"""Whoever hears one can add to it and say the sum: msgpack ends at 2**64, what a JSON reader keeps exactly at 2**53."""
Stamp = Annotated[float, Meta(ge=-1e12, le=1e12)]
"""A moment of somebody's own clock, or the difference of two [s]; also of one that counts from 1970."""
Step = Annotated[float, Meta(ge=0.001, le=NUMBER_MAX)]
"""From one reading to the next [m]: whoever goes along them gets to the end."""


class Header(Struct, frozen=True, array_like=True, gc=False):
    """Who says it, in which of its lives, as how manieth on this topic, and when by its own clock [s]."""

    sender: str
    incarnation: Count
    seq: Count
    stamp: Stamp


# --- terms, members and configs: what the lease protocol agrees on (lease.md 3.1, 3.3) -------------------------


class Term(Struct, frozen=True, array_like=True, order=True, gc=False):
    """An election epoch, totally ordered and never used twice: number, issuer's id and issuer's incarnation."""

    n: Count = 0
    issuer: Count = 0
    incarnation: Count = 0


NO_TERM = Term()


class Member(Struct, frozen=True, array_like=True, order=True, gc=False):
    """One life of one id. Id 0 is the witness: a voter without a robot."""

    id: Count
    incarnation: Count


class Version(Struct, frozen=True, array_like=True, order=True, gc=False):
    """Of a config: the term whose holder wrote it, and a number within that term."""

    term: Term = NO_TERM
    seq: Count = 0


class Electorate(Struct, frozen=True, array_like=True):
    """A set of voters and its tie-breaker: the previous one counts too while a change is joint."""

    voters: tuple[Member, ...]
    tie: Member | None = None
    rule: str = "half"
    """`half` (majority, or one half with the tie-breaker) or `all` (after a full house, lease.md 3.9)."""


class Config(Struct, frozen=True, array_like=True):
    """The one versioned record of a term: who votes and who follows whom. `chain[0]` leads."""

    version: Version
    voters: tuple[Member, ...]
    tie: Member | None
    previous: Electorate | None
    chain: tuple[Member, ...]


class GatewayStamp(Struct, frozen=True, array_like=True, gc=False):
    """A moment of a gateway's own clock, echoed in commands so that their age is judged on one clock only."""

    incarnation: Count
    time: Stamp


# --- the lease protocol's own messages (lease.md 3.3); the header of `LeaseNote` says who speaks -----------------


class Prepare(Struct, frozen=True, array_like=True, tag="prepare"):
    term: Term
    version: Version
    forget: tuple[Member, ...] = ()
    """Lives that an operator declared dead for this attempt only, and with them every earlier one of their ids."""


class Grantee(Struct, frozen=True, array_like=True):
    """Whom a voter is still bound to: the exact term, its holder and the holder's incarnation."""

    term: Term
    holder: Member


class Promise(Struct, frozen=True, array_like=True, tag="promise"):
    term: Term
    config: Config
    needs_fence: Grantee | None
    blank: bool


class Nack(Struct, frozen=True, array_like=True, tag="nack"):
    term: Term
    promised: Term
    holder: Member | None
    remaining_s: Number
    config: Config


class Propose(Struct, frozen=True, array_like=True, tag="propose"):
    """Lease request, renewal, config write and hand-over: the heartbeat."""

    term: Term
    config: Config
    round: Count
    holder: Member
    fenced: tuple[Term, ...] = ()
    nonce: Stamp | None = None


class Grant(Struct, frozen=True, array_like=True, tag="grant"):
    term: Term
    round: Count
    version: Version
    nonce: Stamp


class Release(Struct, frozen=True, array_like=True, tag="release"):
    """The holder's own gateway refuses every term up to `term`, or its residual motion has run out."""

    term: Term


class Hello(Struct, frozen=True, array_like=True, tag="hello"):
    """From anyone who holds no live grant; `version` is None for a blank process."""

    version: Version | None


HELLO_MARK, GRANT_MARK = (msgspec.msgpack.encode(kind.__struct_config__.tag) for kind in (Hello, Grant))
"""Among the bytes of every note that holds one."""


class Fence(Struct, frozen=True, array_like=True, tag="fence"):
    """To the gateway of the robot whose term `old` is to end: refuse everything below `term`."""

    old: Term
    term: Term


class Fenced(Struct, frozen=True, array_like=True, tag="fenced"):
    """From that gateway: `old` can act no more here; nothing below `term` will."""

    old: Term
    term: Term


LeaseBody = Prepare | Promise | Nack | Propose | Grant | Release | Hello | Fence | Fenced


class LeaseNote(Struct, frozen=True, array_like=True, tag="lease"):
    header: Header
    body: LeaseBody


# --- what a robot's hardware says and hears ------------------------------------------------------------------


class Sensors(Struct, frozen=True, array_like=True, tag="sensors"):
    """Wheel odometry and the gateway's state, as of `header.stamp` on the driver's clock."""

    header: Header
    pose_odom: Pose2D
    twist: Twist
    odometer_m: Number
    gateway: GatewayStamp
    term_max: Term
    latched: bool = False
    refused: int = 0


class Localization(Struct, frozen=True, array_like=True, tag="localization"):
    header: Header
    pose_map: Pose2D


class LaserScan(Struct, frozen=True, array_like=True, tag="scan"):
    """REP-117: beyond `range_max_m` is +inf, below `range_min_m` is -inf, a bad reading is nan."""

    header: Header
    angle_min: Number
    angle_increment: Number
    range_min_m: Number
    range_max_m: Number
    ranges_m: tuple[float, ...]


class GroundProfile(Struct, frozen=True, array_like=True, tag="ground"):
    """The floor ahead, looked down upon: heights along three lines parallel to the direction of travel.

    The lines are those of the left wheel, the centre and the right wheel: what lies beside all three is not in the
    way. Point j of line i is at x = `first_m` + j `increment_m`, y = `offsets_m[i]` in `base_link`; its height [m] is
    relative to what the wheels stand on now, negative for a hole. In the spirit of REP-117: a bad or missing reading
    is nan, a floor deeper than the sensor sees is -inf. Walls and bodies are no floor and do not show.
    """

    header: Header
    first_m: Number
    increment_m: Step
    offsets_m: tuple[Number, ...]
    heights_m: tuple[tuple[float, ...], ...]
    """One row a line."""


class Contact(Struct, frozen=True, array_like=True, tag="contact"):
    """The bumper: direction of the touch in `base_link` [rad]."""

    header: Header
    bearing: Number


class CmdVel(Struct, frozen=True, array_like=True, tag="cmd_vel"):
    """A velocity command. `as_leader` tells whether it is one of the lease's holder."""

    header: Header
    twist: Twist
    term: Term
    holder: Count
    as_leader: bool
    gateway: GatewayStamp


# --- what robots tell each other ----------------------------------------------------------------------------


class Role(StrEnum):
    LEADER = "leader"
    FOLLOWER = "follower"
    WAITING = "waiting"


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


# --- ground truth, for recorder and checkers only -------------------------------------------------------------


class TrueRobot(Struct, frozen=True, array_like=True, gc=False):
    id: int
    x: float
    y: float
    theta: float
    linear_x: float
    angular_z: float


class TrueObstacle(Struct, frozen=True, array_like=True, gc=False):
    """A body that moves, by its place in the scenario's list."""

    index: int
    x: float
    y: float


class Truth(Struct, frozen=True, array_like=True, tag="truth"):
    """All bodies at one moment `time_s` of the world's own time (0 at its start)."""

    header: Header
    time_s: float
    robots: tuple[TrueRobot, ...]
    obstacles: tuple[TrueObstacle, ...] = ()


class Clock(Struct, frozen=True, array_like=True, tag="clock"):
    header: Header
    time_s: float


# --- what the supervisors of a fleet's machines say and hear -------------------------------------------------------


class ProcessReport(Struct, frozen=True, array_like=True, gc=False):
    """One process of a machine, as its supervisor sees it."""

    name: str
    state: str
    """`running`, `waiting` (to be started again), `ended` (well, for good), `failed` (given up) or `refused`."""
    pid: int
    """0 while it does not run."""
    starts: int
    began_ms: int
    """Wall clock of its machine at its last start: the incarnation of what it says is no older."""
    up_s: float
    ended: str
    """How its last life ended, in words; empty when it never did."""


class HostStatus(Struct, frozen=True, array_like=True, tag="host"):
    """What runs on one machine of a fleet, once a second and on each change."""

    header: Header
    host: str
    version: str
    run: str
    """Which fleet file, brought up when: hosts of one fleet say the same."""
    obeyed: tuple[int, int]
    """Incarnation and number of the last order that was obeyed: its acknowledgement."""
    processes: tuple[ProcessReport, ...]


class HostOrder(Struct, frozen=True, array_like=True, tag="order"):
    """An operator's word to the supervisors; said again until all whom it concerns have obeyed."""

    header: Header
    deed: str
    """`report`, `restart`, `logs` or `down`."""
    target: str
    """A process (`robot3`, `a/router`), or a host; empty: all."""
    lines: int = 0
    """Of `logs`: how many of the last lines; later ones follow for a few seconds."""


class LogLines(Struct, frozen=True, array_like=True, tag="log"):
    """Lines of the log of one process, as they come."""

    header: Header
    name: str
    lines: tuple[str, ...]


Message = (
    LeaseNote
    | Sensors
    | Localization
    | LaserScan
    | GroundProfile
    | Contact
    | CmdVel
    | PoseStamped
    | TableRow
    | Tracking
    | FormationNote
    | ObstacleNote
    | PlanNote
    | MissionNote
    | Ask
    | OperatorNote
    | Status
    | Event
    | Truth
    | Clock
    | HostStatus
    | HostOrder
    | LogLines
)

_encoder = msgspec.msgpack.Encoder()
_decoder: msgspec.msgpack.Decoder[Message] = msgspec.msgpack.Decoder(Message)


class BadMessage(ValueError):
    """Bytes from the network that are no message of ours: too long, truncated, foreign, or with absurd numbers."""


def encode(message: Message) -> bytes:
    return _encoder.encode(message)


def decode(payload: bytes, expected: type) -> Message:
    """The message in `payload`. Raises BadMessage when it is no well-formed one of type `expected`.

    Numbers that a core computes with are finite; ranges and heights alone may be infinite or nan (REP-117).
    """
    if len(payload) > MESSAGE_BYTES_MAX:
        raise BadMessage(f"{len(payload)} bytes, more than {MESSAGE_BYTES_MAX}")
    try:
        message = _decoder.decode(payload)
    except (msgspec.DecodeError, msgspec.ValidationError, RecursionError, UnicodeDecodeError) as error:
        raise BadMessage(str(error)) from None
    if type(message) is not expected:
        raise BadMessage(f"{type(message).__name__} where {expected.__name__} belongs")
    if not _FITS.get(expected, _anything)(message):
        raise BadMessage(f"{type(message).__name__} whose parts do not fit together")
    return message


# What no single field's type tells. A table: whoever hears hundreds of messages a second asks each once.


def _anything(_message: Message) -> bool:
    return True


def _fitting_ground(message: GroundProfile) -> bool:
    return len(message.offsets_m) == len(message.heights_m)


def _fitting_plan(message: PlanNote) -> bool:
    return message.columns > 0 and len(message.cells) % message.columns == 0


_FITS: dict[type, Callable[[Any], bool]] = {GroundProfile: _fitting_ground, PlanNote: _fitting_plan}
