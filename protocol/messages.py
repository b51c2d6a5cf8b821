"""All that travels between processes, as frozen structs, and the codec (msgpack, one array a message).

Every message begins with a `Header`: Zenoh samples carry no sender, and a stamp of the sender's own monotonic
clock is the only time that means anything. Between machines only differences of stamps do.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from itertools import chain
from math import isfinite
from typing import Any

import msgspec
from msgspec import Struct

from protocol.geometry import Pose2D, Twist
from protocol.mission import Mission

WIRE_VERSION = 1
MESSAGE_BYTES_MAX = 64 * 1024


class Header(Struct, frozen=True, array_like=True, gc=False):
    """Who says it, in which of its lives, as how manieth on this topic, and when by its own clock [s]."""

    sender: str
    incarnation: int
    seq: int
    stamp: float


# --- terms, members and configs: what the lease protocol agrees on (lease.md 3.1, 3.3) -------------------------


class Term(Struct, frozen=True, array_like=True, order=True, gc=False):
    """An election epoch, totally ordered and never used twice: number, issuer's id and issuer's incarnation."""

    n: int = 0
    issuer: int = 0
    incarnation: int = 0


NO_TERM = Term()


class Member(Struct, frozen=True, array_like=True, order=True, gc=False):
    """One life of one id. Id 0 is the witness: a voter without a robot."""

    id: int
    incarnation: int


class Version(Struct, frozen=True, array_like=True, order=True, gc=False):
    """Of a config: the term whose holder wrote it, and a number within that term."""

    term: Term = NO_TERM
    seq: int = 0


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

    incarnation: int
    time: float


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
    remaining_s: float
    config: Config


class Propose(Struct, frozen=True, array_like=True, tag="propose"):
    """Lease request, renewal, config write and hand-over: the heartbeat."""

    term: Term
    config: Config
    round: int
    holder: Member
    fenced: tuple[Term, ...] = ()
    nonce: float | None = None


class Grant(Struct, frozen=True, array_like=True, tag="grant"):
    term: Term
    round: int
    version: Version
    nonce: float


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
    odometer_m: float
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
    angle_min: float
    angle_increment: float
    range_min_m: float
    range_max_m: float
    ranges_m: tuple[float, ...]


class GroundProfile(Struct, frozen=True, array_like=True, tag="ground"):
    """The floor ahead, looked down upon: heights along three lines parallel to the direction of travel.

    The lines are those of the left wheel, the centre and the right wheel: what lies beside all three is not in the
    way. Point j of line i is at x = `first_m` + j `increment_m`, y = `offsets_m[i]` in `base_link`; its height [m] is
    relative to what the wheels stand on now, negative for a hole. In the spirit of REP-117: a bad or missing reading
    is nan, a floor deeper than the sensor sees is -inf. Walls and bodies are no floor and do not show.
    """

    header: Header
    first_m: float
    increment_m: float
    offsets_m: tuple[float, ...]
    heights_m: tuple[tuple[float, ...], ...]
    """One row a line."""


class Contact(Struct, frozen=True, array_like=True, tag="contact"):
    """The bumper: direction of the touch in `base_link` [rad]."""

    header: Header
    bearing: float


class CmdVel(Struct, frozen=True, array_like=True, tag="cmd_vel"):
    """A velocity command. `as_leader` tells whether it is one of the lease's holder."""

    header: Header
    twist: Twist
    term: Term
    holder: int
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
    x: float
    y: float
    z: float
    theta: float
    twist: Twist
    odometer_m: float
    role: Role
    term: Term


class Delay(Struct, frozen=True, array_like=True, gc=False):
    """Least (receive - send) seen from a peer [s]: one half of a round trip, for the clock offset."""

    robot: int
    least_s: float


class TableRow(Struct, frozen=True, array_like=True, tag="table"):
    """The paper's table (X, Y, Z, theta), kept by all of all."""

    header: Header
    x: float
    y: float
    z: float
    theta: float
    odometer_m: float
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

    robot: int
    separation_m: float
    phi: float


class FormationNote(Struct, frozen=True, array_like=True, tag="formation"):
    """The orientation request of the leader of `term`; the highest (term, number) counts."""

    header: Header
    term: Term
    number: int
    slots: tuple[Slot, ...]
    trace: bool = False


class ObstacleNote(Struct, frozen=True, array_like=True, tag="obstacles"):
    """What one robot met or tracks, shared with all; position in `map`."""

    header: Header
    kind: str
    x: float
    y: float
    radius_m: float
    twist_map: tuple[float, float] = (0.0, 0.0)


class PlanNote(Struct, frozen=True, array_like=True, tag="plan"):
    """What who leads through unknown ground knows and intends, for recorder and views: its route, a tile of its map."""

    header: Header
    route_map: tuple[tuple[float, float], ...]
    """x, y [m]."""
    cell_m: float
    corner_map: tuple[float, float]
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
    """The message in `payload`. Raises BadMessage when it is not a finite, well-formed one of type `expected`."""
    if len(payload) > MESSAGE_BYTES_MAX:
        raise BadMessage(f"{len(payload)} bytes, more than {MESSAGE_BYTES_MAX}")
    try:
        message = _decoder.decode(payload)
    except (msgspec.DecodeError, msgspec.ValidationError, RecursionError, UnicodeDecodeError) as error:
        raise BadMessage(str(error)) from None
    if type(message) is not expected:
        raise BadMessage(f"{type(message).__name__} where {expected.__name__} belongs")
    if not (isfinite(message.header.stamp) and _SANE.get(expected, _anything)(message)):
        raise BadMessage(f"{type(message).__name__} with a number that is not finite")
    return message


# Numbers that a core computes with are finite; ranges and heights alone may be infinite or nan (REP-117). A sum is
# finite only when all in it are. A table: whoever hears hundreds of messages a second asks each once.


def _anything(_message: Message) -> bool:
    return True


def _sane_pose(message: PoseStamped) -> bool:
    twist = message.twist
    place = message.x + message.y + message.z + message.theta
    return isfinite(place + message.odometer_m + twist.linear_x + twist.angular_z)


def _sane_row(message: TableRow) -> bool:
    return isfinite(message.x + message.y + message.z + message.theta + message.odometer_m)


def _sane_command(message: CmdVel) -> bool:
    twist = message.twist
    return isfinite(twist.linear_x + twist.angular_z + message.gateway.time)


def _sane_sensors(message: Sensors) -> bool:
    pose, twist = message.pose_odom, message.twist
    moved = pose.x + pose.y + pose.theta + twist.linear_x + twist.angular_z
    return isfinite(moved + message.odometer_m + message.gateway.time)


def _sane_fix(message: Localization) -> bool:
    pose = message.pose_map
    return isfinite(pose.x + pose.y + pose.theta)


def _sane_scan(message: LaserScan) -> bool:
    return isfinite(message.angle_min + message.angle_increment + message.range_min_m + message.range_max_m)


def _sane_ground(message: GroundProfile) -> bool:
    return isfinite(message.first_m + message.increment_m + sum(message.offsets_m))


def _sane_formation(message: FormationNote) -> bool:
    return all(isfinite(slot.separation_m + slot.phi) for slot in message.slots)


def _sane_obstacle(message: ObstacleNote) -> bool:
    return isfinite(message.x + message.y + message.radius_m + sum(message.twist_map))


def _sane_plan(message: PlanNote) -> bool:
    whole = message.columns > 0 and len(message.cells) % message.columns == 0
    return whole and isfinite(message.cell_m + sum(message.corner_map) + sum(chain.from_iterable(message.route_map)))


def _sane_lease(message: LeaseNote) -> bool:
    match message.body:
        case Grant(nonce=nonce):
            return isfinite(nonce)
        case Nack(remaining_s=remaining_s):
            return isfinite(remaining_s)
        case Propose(nonce=nonce):
            return nonce is None or isfinite(nonce)
    return True


_SANE: dict[type, Callable[[Any], bool]] = {
    PoseStamped: _sane_pose,
    TableRow: _sane_row,
    CmdVel: _sane_command,
    Sensors: _sane_sensors,
    Localization: _sane_fix,
    LaserScan: _sane_scan,
    GroundProfile: _sane_ground,
    FormationNote: _sane_formation,
    ObstacleNote: _sane_obstacle,
    PlanNote: _sane_plan,
    LeaseNote: _sane_lease,
}
