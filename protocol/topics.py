"""The table of topics: the source of keys, QoS, freshness, the recorder's channels and the access rules.

A key is `lfa/<fleet>/<owner>/<topic>`; `lease` and `alive` carry one more part: the receiver, or the incarnation.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, NamedTuple

from msgspec import Struct

from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import BadMessage, Message, decode
from lfa.protocol.messages.consensus import LeaseNote
from lfa.protocol.messages.fleet import HostOrder, HostStatus, LogLines
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

Priority = Literal["real_time", "prompt", "data", "background"]

TO_ALL = "all"
TO_HELLO = "hello"
"""Receiver in the key of a HELLO, which goes to all as well: an inbox knows by the key alone that it can wait."""
WORLD_NAME = "world"
OPERATOR_NAME = "operator"
RECORDER_NAME = "recorder"
DRIVER_PREFIX = "driver"
"""Prefix of a driver's name: the driver of robot `robot3` is `driver3`; it publishes hardware topics on robot keys."""
HOST_PREFIX = "host-"
"""Prefix of a supervisor's name: the supervisor of machine `a` publishes as `host-a`."""


class Topic(Struct, frozen=True):
    """Row of the table: message type of a name, its publishers, rate, QoS and freshness."""

    name: str
    type: type
    publishers: tuple[str, ...]
    rate_hz: float | None
    """Publication rate [Hz]; None: on events."""
    state: bool
    """True: only the newest value counts, and a receiver keeps one value per key. False: each message counts."""
    wakes: bool
    """True: processed at arrival. False: read at the receiver's next deadline."""
    priority: Priority
    timeout_s: float | None
    """Age [s] beyond which a message is stale; None: never."""


TEAM = ("agent", "witness", "driver")
ANYONE = (*TEAM, "operator", "world")

#         name            type             publishers             rate  state  wakes  priority      timeout
TOPICS: tuple[Topic, ...] = (
    Topic("mission",      MissionNote,   ("operator", "world"), None, False, True,  "prompt",     None),
    Topic("ask",          Ask,           (*TEAM, "operator"),   None, False, True,  "prompt",     None),
    Topic("pose",         PoseStamped,   ("agent",),            50.0, True,  False, "real_time",  0.5),
    Topic("table",        TableRow,      ("agent",),            2.0,  True,  False, "data",       3.0),
    Topic("tracking",     Tracking,      ("agent",),            25.0, True,  False, "background", 1.0),
    Topic("cmd_vel",      CmdVel,        ("agent",),            50.0, False, False, "real_time",  0.06),
    Topic("lease",        LeaseNote,     TEAM,                  None, False, True,  "real_time",  None),
    Topic("formation",    FormationNote, ("agent",),            1.0,  True,  True,  "prompt",     3.0),
    Topic("obstacles",    ObstacleNote,  ("agent",),            None, False, False, "data",       None),
    Topic("plan",         PlanNote,      ("agent",),            5.0,  False, False, "background", None),
    Topic("operator",     OperatorNote,  ("operator",),         None, False, True,  "prompt",     None),
    Topic("stop",         StopOrder,     ("operator",),         None, False, True,  "real_time",  None),
    Topic("stop_state",   StopState,     ("driver",),           None, False, True,  "real_time",  None),
    Topic("stop_known",   StopReport,    ("agent",),            None, False, True,  "prompt",     None),
    Topic("team_order",   OrderNote,     ("agent", "operator"), None, False, True,  "prompt",     None),
    Topic("status",       Status,        TEAM,                  1.0,  True,  False, "background", 3.0),
    Topic("event",        Event,         ANYONE,                None, False, False, "background", None),
    Topic("sensors",      Sensors,       ("driver",),           50.0, True,  False, "real_time",  0.2),
    Topic("localization", Localization,  ("driver",),           10.0, True,  False, "real_time",  1.0),
    Topic("scan",         LaserScan,     ("driver",),           10.0, True,  False, "data",       0.35),
    Topic("ground",       GroundProfile, ("driver",),           20.0, True,  False, "data",       0.25),
    Topic("contact",      Contact,       ("driver",),           None, False, False, "data",       None),
    Topic("reading",      SensorReading, ("driver",),           None, False, False, "data",       None),
    Topic("truth",        Truth,         ("world",),            50.0, False, False, "background", None),
    Topic("clock",        Clock,         ("world",),            1.0,  True,  False, "background", None),
    Topic("host",         HostStatus,    ("host",),             1.0,  True,  True,  "data",       3.0),
    Topic("order",        HostOrder,     ("operator",),         None, False, True,  "prompt",     None),
    Topic("log",          LogLines,      ("host",),             None, False, True,  "background", None),
)  # fmt: skip

NO_ECHO = frozenset({"lease", "table", "formation", "obstacles"})
"""Topics that their publishers also subscribe to; own samples are filtered out: they would only wake it."""
TOPIC: dict[str, Topic] = {topic.name: topic for topic in TOPICS}
TRUTH_OWNER = "sim"
HARDWARE = ("sensors", "localization", "scan", "ground", "contact", "reading")


def fleet_name(text: str) -> str:
    """Return `text` if it can be the fleet part of a key. Raises Refused."""
    if not text or not all(c.isalnum() or c in "-_." for c in text):
        raise Refused(f"--fleet {text!r}: must be letters, digits, '-', '_' or '.'")
    return text


def key(fleet: str, owner: str, topic: str, to: str | None = None) -> str:
    """Return `lfa/<fleet>/<owner>/<topic>[/<to>]`. Raises KeyError for a topic outside the table."""
    base = f"lfa/{fleet}/{owner}/{TOPIC[topic].name}"
    return base if to is None else f"{base}/{to}"


def alive_key(fleet: str, owner: str, incarnation: int | str) -> str:
    """Return the key of the liveliness token of one incarnation of a process; `*` stands for any."""
    return f"lfa/{fleet}/{owner}/alive/{incarnation}"


class Address(Struct, frozen=True):
    """Parsed key: fleet, owner, topic, and the receiver or incarnation where the topic has one."""

    fleet: str
    owner: str
    topic: str
    to: str | None


@lru_cache(maxsize=4096)
def address(key: str) -> Address | None:
    """Return the parts of a key; None for a foreign key. The cache is bounded, as foreign senders may use any key."""
    parts = key.split("/")
    if len(parts) not in (4, 5) or parts[0] != "lfa":
        return None
    if parts[3] not in TOPIC and parts[3] != "alive":
        return None
    return Address(parts[1], parts[2], parts[3], parts[4] if len(parts) == 5 else None)


def message_in(key: str, payload: bytes) -> Message | None:
    """Return the message of the topic of `key` in `payload`; None for a foreign key and bytes that do not decode."""
    expected = expected_on(key)
    try:
        return None if expected is None else decode(payload, expected.kind)
    except BadMessage:
        return None


class Expected(NamedTuple):
    """What messages on one key are: their type, and the senders that their headers may name."""

    kind: type
    signers: frozenset[str]


@lru_cache(maxsize=4096)
def expected_on(key: str) -> Expected | None:
    """Return what belongs on `key`; None for a foreign key.

    Routers check the key, cores the header: both must name the same process; otherwise a process could publish on
    its own key in another's name. Only hardware topics and ground truth may come from the driver or the world instead.
    """
    where = address(key)
    topic = None if where is None else TOPIC.get(where.topic)
    if where is None or topic is None:
        return None
    plays = "driver" in topic.publishers or "world" in topic.publishers
    players = (WORLD_NAME, where.owner.replace("robot", DRIVER_PREFIX, 1)) if plays else ()
    return Expected(topic.type, frozenset((where.owner, *players)))


def matches(expression: str, key: str) -> bool:
    """Return True if `key` matches `expression`: Zenoh's `*` for one part and a last `**` for any rest only."""
    if expression == key:
        return True
    wanted, parts = expression.split("/"), key.split("/")
    if wanted[-1] == "**":
        wanted = wanted[:-1]
        parts = parts[: len(wanted)]
    return len(wanted) == len(parts) and all(w in ("*", p) for w, p in zip(wanted, parts, strict=True))
