"""Wire format of `rmw_zenoh`: keys, liveliness tokens, QoS text, GIDs and attachments. Pure.

A ROS 2 node over Zenoh publishes CDR on `<domain>/<topic>/<type>/<hash>`, with an attachment of 33 bytes. It appears in
the ROS graph through one liveliness token per node, publisher, subscription, service and client. A malformed attachment
aborts every ROS process that subscribes, so `attachment` is the only function that builds one. Source: rmw_zenoh_cpp
0.2.10 to 0.12.0, `liveliness_utils`, `attachment_helpers` and `qos`; versions before 0.2.4 have another attachment.
"""

from __future__ import annotations

import re
import struct
from typing import Literal

import xxhash
from msgspec import Struct

from lfa.protocol.errors import Refused

Kind = Literal["NN", "MP", "MS", "SS", "SC"]
"""Node, publisher, subscription, service, client."""
Distro = Literal["humble", "jazzy", "kilted", "lyrical", "rolling"]

TOKENS = "@ros2_lv"
HASHLESS = "TypeHashNotSupported"
"""Text in place of a type hash in the keys and tokens of Humble."""
NO_NAMESPACE = ""
DOMAIN_MAX = 232
ATTACHMENT_BYTES = 33
GID_BYTES = 16
DEPTH_DEFAULT = 42
"""History depth that the QoS text leaves out."""
_ATTACHMENT = struct.Struct("<qqB16s")
_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_KINDS = ("MP", "MS", "SS", "SC")
_NODE_PARTS, _ENDPOINT_PARTS = 9, 13


class Qos(Struct, frozen=True):
    """Quality of service as far as it differs between topics here; `latched` is ROS's transient local."""

    depth: int = 10
    reliable: bool = True
    latched: bool = False
    lifespan_s: int | None = None

    @property
    def text(self) -> str:
        """Text of a token, `R:D:H,depth:deadline:lifespan:L,lease`; a field that has its default value is empty."""
        reliability, durability = "" if self.reliable else "2", "1" if self.latched else ""
        depth = "" if self.depth == DEPTH_DEFAULT else str(self.depth)
        lifespan = "," if self.lifespan_s is None else f"{self.lifespan_s},0"
        return f"{reliability}:{durability}:,{depth}:,:{lifespan}:,,"


DEFAULT = Qos()
SENSOR_DATA = Qos(depth=5, reliable=False)
LATCHED = Qos(depth=1, latched=True)
ROSOUT = Qos(depth=1000, latched=True, lifespan_s=10)


class RosNode(Struct, frozen=True):
    """One node of one Zenoh session."""

    domain: int
    session: str
    """Session id as Zenoh prints it."""
    id: int
    namespace: str
    """Like `/robot3`; empty for none."""
    name: str

    @property
    def token(self) -> str:
        return f"{TOKENS}/{self.domain}/{self.session}/{self.id}/{self.id}/NN/{self._names}"

    @property
    def _names(self) -> str:
        return f"%/{mangled(self.namespace)}/{self.name}"

    @property
    def full_name(self) -> str:
        return f"{self.namespace}/{self.name}"


class RosEndpoint(Struct, frozen=True):
    """One publisher, subscription, service or client of a node."""

    node: RosNode
    id: int
    kind: Kind
    topic: str
    """Fully qualified, like `/robot3/odom`."""
    type: str
    """Like `nav_msgs/msg/Odometry`."""
    hash: str
    qos: Qos

    @property
    def token(self) -> str:
        node = self.node
        head = f"{TOKENS}/{node.domain}/{node.session}/{node.id}/{self.id}/{self.kind}/{node._names}"
        return f"{head}/{mangled(self.topic)}/{dds_type(self.type)}/{self.hash}/{self.qos.text}"

    @property
    def key(self) -> str:
        """Key of the endpoint's samples, queries and replies."""
        return data_key(self.node.domain, self.topic, self.type, self.hash)

    @property
    def gid(self) -> bytes:
        return gid(self.token)


def mangled(name: str) -> str:
    """Return `name` as one part of a token: each `/` as `%`, and `%` for an empty name."""
    return name.replace("/", "%") or "%"


def dds_type(ros_type: str) -> str:
    """Return the DDS name of a type: `nav_msgs::msg::dds_::Odometry_` for `nav_msgs/msg/Odometry`."""
    package, kind, name = ros_type.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type(dds: str) -> str | None:
    """Return the ROS name of a DDS type name; None if it is none."""
    parts = dds.split("::")
    if len(parts) != 4 or parts[2] != "dds_" or not parts[3].endswith("_"):
        return None
    return f"{parts[0]}/{parts[1]}/{parts[3][:-1]}"


def data_key(domain: int, topic: str, ros_type: str, type_hash: str) -> str:
    return f"{domain}/{topic.strip('/')}/{dds_type(ros_type)}/{type_hash}"


def gid(token: str) -> bytes:
    """Return the 16 bytes that identify an endpoint: XXH3-128 of its token, the low half first, little endian."""
    return xxhash.xxh3_128_intdigest(token.encode()).to_bytes(GID_BYTES, "little")


def attachment(number: int, time_ns: int, gid: bytes) -> bytes:
    """Return the attachment of a sample, query or reply. Numbers of a publisher begin at 1; time is UNIX [ns].

    The only builder of attachments: genuine subscribers abort on any other form.
    """
    assert len(gid) == GID_BYTES, gid
    built = _ATTACHMENT.pack(number, time_ns, GID_BYTES, gid)
    assert len(built) == ATTACHMENT_BYTES, built
    return built


class Attached(Struct, frozen=True):
    """Contents of an attachment: sequence number, source time [ns, UNIX] and the sender's GID."""

    number: int
    time_ns: int
    gid: bytes


def read_attachment(data: bytes) -> Attached | None:
    """Return the contents of an attachment; None for bytes that are none."""
    if len(data) != ATTACHMENT_BYTES:
        return None
    number, time_ns, size, sender = _ATTACHMENT.unpack(data)
    return Attached(number, time_ns, sender) if size == GID_BYTES else None


def read_token(key: str) -> RosNode | RosEndpoint | None:
    """Return the node or endpoint of a token; None for a key that is none.

    Endpoints of newer distributions may carry a fourteenth part about their buffers, which is ignored.
    """
    parts = key.split("/")
    if len(parts) < _NODE_PARTS or parts[0] != TOKENS or not all(parts):
        return None
    domain, node_id, own_id = (_number(part) for part in (parts[1], parts[3], parts[4]))
    if domain is None or node_id is None or own_id is None or domain > DOMAIN_MAX:
        return None
    node = RosNode(domain, parts[2], node_id, _plain(parts[7]), parts[8])
    if parts[5] == "NN":
        return node if len(parts) == _NODE_PARTS else None
    if len(parts) not in (_ENDPOINT_PARTS, _ENDPOINT_PARTS + 1):
        return None
    kind = next((kind for kind in _KINDS if kind == parts[5]), None)
    of_type, qos = ros_type(parts[10]), read_qos(parts[12])
    if kind is None or of_type is None or qos is None:
        return None
    return RosEndpoint(node, own_id, kind, _plain(parts[9]), of_type, parts[11], qos)  # type: ignore[arg-type]


def read_qos(text: str) -> Qos | None:
    """Return the quality of service of a token's text; None if it is malformed."""
    fields = text.split(":")
    if len(fields) != 6:
        return None
    reliability, durability, history, _, lifespan, _ = fields
    depth, seconds = history.split(",")[-1], lifespan.split(",")[0]
    if any(number and _number(number) is None for number in (reliability, durability, depth, seconds)):
        return None
    return Qos(int(depth or DEPTH_DEFAULT), reliability != "2", durability == "1", int(seconds) if seconds else None)


def check_name(name: str, option: str) -> str:
    """Return `name` if it is a full ROS name like `/robot3/odom`. Raises Refused."""
    if _NAME.fullmatch(name) is None:
        raise Refused(f"{option} {name!r}: must be a full ROS name of letters, digits and '_', like /robot3/odom")
    return name


def check_domain(domain: int) -> int:
    """Return `domain` if it can be a ROS_DOMAIN_ID. Raises Refused."""
    if not 0 <= domain <= DOMAIN_MAX:
        raise Refused(f"--domain {domain}: must be a ROS_DOMAIN_ID, 0 to {DOMAIN_MAX}")
    return domain


def _plain(part: str) -> str:
    return "" if part == "%" else part.replace("%", "/")


def _number(part: str) -> int | None:
    return int(part) if part.isascii() and part.isdigit() and len(part) < 19 else None
