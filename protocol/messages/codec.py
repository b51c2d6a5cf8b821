"""Union of all messages between processes, and the codec (msgpack, one array per message).

Every message begins with a `Header`: Zenoh samples carry no sender, and a stamp of the sender's own monotonic
clock is the only usable time. Between machines only differences of stamps are meaningful.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from lfa.protocol.messages.consensus import LeaseNote
from lfa.protocol.messages.fleet import HostOrder, HostStatus, LogLines
from lfa.protocol.messages.header import MESSAGE_BYTES_MAX
from lfa.protocol.messages.orders import OrderNote
from lfa.protocol.messages.robot import (
    CmdVel,
    Contact,
    GroundProfile,
    LaserScan,
    Localization,
    SensorReading,
    Sensors,
)
from lfa.protocol.messages.simulation import Clock, Truth
from lfa.protocol.messages.stop import StopOrder, StopReport, StopState
from lfa.protocol.messages.team import (
    Ask,
    Event,
    FormationNote,
    MissionNote,
    ObstacleNote,
    OperatorNote,
    PlanNote,
    PoseStamped,
    Status,
    TableRow,
    Tracking,
)
from lfa.protocol.mission import CONTROL_HZ, CONTROL_HZ_MIN

Message = (
    LeaseNote
    | Sensors
    | Localization
    | LaserScan
    | GroundProfile
    | Contact
    | SensorReading
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
    | StopOrder
    | StopState
    | StopReport
    | OrderNote
)

_encoder = msgspec.msgpack.Encoder()
_decode: Callable[[bytes], Message] = msgspec.msgpack.Decoder(Message).decode


DATA_DEPTH_MAX = 8
"""Maximum nesting of what an event or an operator's command says; its readers descend into it."""


class BadMessage(ValueError):
    """Bytes from the network that are no valid message: too long, truncated, foreign, or with numbers out of bounds."""


def encode(message: Message) -> bytes:
    return _encoder.encode(message)


def decode(payload: bytes, expected: type) -> Message:
    """Return the message in `payload`. Raises BadMessage if it is no well-formed message of type `expected`.

    Numbers that a core computes with are finite; only ranges and heights may be infinite or nan (REP-117).
    """
    if len(payload) > MESSAGE_BYTES_MAX:
        raise BadMessage(f"{len(payload)} bytes, more than {MESSAGE_BYTES_MAX}")
    try:
        message = _decode(payload)
    except (msgspec.DecodeError, msgspec.ValidationError, RecursionError, UnicodeDecodeError) as error:
        raise BadMessage(str(error)) from None
    if type(message) is not expected:
        raise BadMessage(f"{type(message).__name__} where {expected.__name__} belongs")
    fits = _FITS.get(expected)
    if fits is not None and not fits(message):
        raise BadMessage(f"{type(message).__name__} whose parts do not fit together")
    return message


# Checks across several fields. A table, so that a receiver of hundreds of messages a second does one look-up for each.


def _fitting_ground(message: GroundProfile) -> bool:
    return len(message.offsets_m) == len(message.heights_m)


def _fitting_plan(message: PlanNote) -> bool:
    return message.columns > 0 and len(message.cells) % message.columns == 0


def _fitting_mission(message: MissionNote) -> bool:
    """Return True if durations can be computed from it: witness and driver have no other check of a mission."""
    return CONTROL_HZ_MIN <= message.mission.control_hz <= CONTROL_HZ


def _fitting_event(message: Event) -> bool:
    return _plain(message.data, DATA_DEPTH_MAX)


def _fitting_command(message: OperatorNote) -> bool:
    return _plain(message.arguments, DATA_DEPTH_MAX)


def _plain(value: Any, depth: int) -> bool:
    """Return True for what JSON says, in at most `depth` levels; msgpack also has extensions, and keys of any type."""
    if isinstance(value, dict):
        return depth > 0 and all(isinstance(name, str) and _plain(one, depth - 1) for name, one in value.items())
    if isinstance(value, list | tuple):
        return depth > 0 and all(_plain(one, depth - 1) for one in value)
    return value is None or isinstance(value, str | int | float)


_FITS: dict[type, Callable[[Any], bool]] = {
    Event: _fitting_event,
    OperatorNote: _fitting_command,
    GroundProfile: _fitting_ground,
    PlanNote: _fitting_plan,
    MissionNote: _fitting_mission,
}
