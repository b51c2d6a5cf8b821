"""ROS message types: their pinned hashes, and conversion to and from CDR.

Standard types only, in the definitions of Jazzy, which Humble, Kilted and Lyrical share for each type listed here. The
library is loaded with the first message that is read: a bridge that only tells of its fleet does without its memory.
"""

from __future__ import annotations

import struct
from functools import cache
from typing import TYPE_CHECKING, Any

from lfa.deploy.ros.cdr import CdrMessage
from lfa.deploy.ros.wire import HASHLESS, Distro

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

PAYLOAD_BYTES_MAX = 1024 * 1024
"""Largest payload that is decoded: a scan of 250 000 beams."""

HASHES: dict[str, str] = {
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "geometry_msgs/msg/PoseStamped": "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
    "geometry_msgs/msg/Twist": "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "geometry_msgs/msg/TwistStamped": "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    "nav_msgs/msg/OccupancyGrid": "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7",
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "nav_msgs/msg/Path": "1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b",
    "rcl_interfaces/msg/Log": "e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac",
    "rosgraph_msgs/msg/Clock": "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564",
    "sensor_msgs/msg/LaserScan": "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828",
    "std_msgs/msg/Int32": "b6578ded3c58c626cfe8d1a6fb6e04f706f97e9f03d2727c9ff4e74b1cef0deb",
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "visualization_msgs/msg/MarkerArray": "86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf",
    "std_srvs/srv/Trigger": "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    "std_srvs/srv/SetBool": "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
}
"""SHA-256 of each type's description (REP-2011), as genuine ROS 2 writes it into keys and tokens."""

_SERVICES = {
    # An empty struct is one byte on the wire.
    "std_srvs/msg/Trigger_Request": "uint8 structure_needs_at_least_one_member",
    "std_srvs/msg/Trigger_Response": "bool success\nstring message",
    "std_srvs/msg/SetBool_Request": "bool data",
    "std_srvs/msg/SetBool_Response": "bool success\nstring message",
}
"""Requests and responses of services; the library knows messages only."""


class BadRosMessage(ValueError):
    """Bytes from the ROS side that are no valid message of the expected type."""


@cache
def typestore() -> Typestore:
    """Return the store of all message types, services included."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    for name, definition in _SERVICES.items():
        store.register(get_types_from_msg(definition, name))
    return store


@cache
def kind(name: str) -> Any:
    """Return the class of the messages of type `name`, like `nav_msgs/msg/Odometry`. Raises KeyError."""
    return typestore().types[name]


def type_hash(name: str, distro: Distro = "jazzy") -> str:
    """Return the hash part of keys and tokens. Raises KeyError for a type outside the table."""
    return HASHLESS if distro == "humble" else f"RIHS01_{HASHES[name]}"


def to_cdr(message: Any) -> bytes:
    """Return `message` as CDR with its header, little endian: encoded already, or made by a class of `kind`."""
    if isinstance(message, CdrMessage):
        return message.payload
    return bytes(typestore().serialize_cdr(message, message.__msgtype__))


def from_cdr(payload: bytes, name: str) -> Any:
    """Return the message of type `name` in `payload`. Raises BadRosMessage for any other bytes."""
    if len(payload) > PAYLOAD_BYTES_MAX:
        raise BadRosMessage(f"{len(payload)} bytes, more than {PAYLOAD_BYTES_MAX}")
    try:
        return typestore().deserialize_cdr(payload, name)
    except _unreadable() as error:
        raise BadRosMessage(f"no {name}: {type(error).__name__}") from None


@cache
def _unreadable() -> tuple[type[Exception], ...]:
    """Return what the library raises for bytes that are no message."""
    from rosbags.serde.errors import SerdeError

    known = (struct.error, ValueError, AssertionError, IndexError, TypeError, OverflowError, MemoryError)
    return (SerdeError, *known)


def request_type(service: str) -> str:
    """Return the message type of a service's request: `std_srvs/msg/Trigger_Request` for `std_srvs/srv/Trigger`."""
    return f"{service.replace('/srv/', '/msg/')}_Request"


def response_type(service: str) -> str:
    return f"{service.replace('/srv/', '/msg/')}_Response"
