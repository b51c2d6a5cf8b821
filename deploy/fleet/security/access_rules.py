"""Who may say and hear what, as the rules that a secure router reads: from the table of topics, and who lives where.

A robot speaks under its own name, and only what the table's column `publishers` lets an agent say; the world speaks
for the hardware that it simulates. A router admits from a neighbour router only what those may say whose place is
there: whoever owns a machine can speak as everybody who lives on it, and as nobody else (zenoh.md section 5).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from msgspec import Struct

from lfa.protocol.messages.header import MESSAGE_BYTES_MAX
from lfa.protocol.names import WITNESS_NAME, robot_id_of
from lfa.protocol.topics import (
    DRIVER_PREFIX,
    HOST_PREFIX,
    OPERATOR_NAME,
    RECORDER_NAME,
    TO_ALL,
    TOPICS,
    TRUTH_OWNER,
    WORLD_NAME,
    Topic,
)

FLOOD_RATIO, FLOOD_HZ_MIN = 10.0, 50.0
"""A topic may come so many times as often as the table says; what is more is dropped where it comes in."""
FLOOD_HZ = {"lease": 2000.0, "obstacles": 500.0, "ask": 50.0}
"""Of topics that come on events. Zenoh drops what follows the last one too soon, so a cap is also the least interval
on a key: no agent says two of these in one breath. `event` has none: two at once are usual, and only persons listen."""
LEARN = ("declare_subscriber", "declare_queryable", "query", "liveliness_query", "declare_liveliness_subscriber")
"""What tells a client who listens; without it, it sends nothing."""
ASK = ("declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber")
SAY = ("put", "liveliness_token")
HEAR = ("put", "reply", "liveliness_token")


class KeyPlan(Struct, frozen=True):
    """A fleet's machines, and who joins at which of their routers."""

    fleet: str
    hosts: dict[str, tuple[str, ...]]
    """Name of a machine: its addresses and names in the network."""
    places: dict[str, tuple[str, ...]]
    """`robot3`, `world`, `operator`, `host-a`, ..: the machines whose routers it may join, its home first."""

    def at(self, host: str) -> list[str]:
        """Who may join there."""
        return [name for name, hosts in self.places.items() if host in hosts]

    def kept_at(self, host: str) -> list[str]:
        """Whose keys lie there: those who run there, and those of the persons who look on from anywhere."""
        persons = (OPERATOR_NAME, RECORDER_NAME)
        return [name for name in self.at(host) if name in persons or self.places[name][0] == host]

    def simulated(self) -> list[str]:
        """The robots whose hardware the world plays: those without a driver of their own."""
        robots = [name for name in self.places if robot_id_of(name)]
        return [name for name in robots if driver_of(name) not in self.places]


def driver_of(robot: str) -> str:
    """The name of the process that drives a real robot: `driver3` of `robot3`."""
    return robot.replace("robot", DRIVER_PREFIX, 1)


def host_name(host: str) -> str:
    """As whom machine `a`'s router and supervisor speak: `host-a`."""
    return f"{HOST_PREFIX}{host}"


def voices(name: str, plan: KeyPlan) -> list[tuple[str, str]]:
    """As which kind (the table's `publishers`) under which owner's keys `name` may speak."""
    if name == WORLD_NAME:
        hardware = [("driver", robot) for robot in plan.simulated()]
        witness = [] if WITNESS_NAME in plan.places else [("witness", WITNESS_NAME)]
        return [("world", WORLD_NAME), ("world", TRUTH_OWNER), *witness, *hardware]
    if name == WITNESS_NAME:
        return [("witness", WITNESS_NAME)]
    if name == OPERATOR_NAME:
        return [("operator", OPERATOR_NAME)]
    if name.startswith(HOST_PREFIX):
        return [("host", name)]
    if name.startswith(DRIVER_PREFIX):
        return [("driver", name), ("driver", name.replace(DRIVER_PREFIX, "robot", 1))]
    return [("agent", name)] if robot_id_of(name) else []


def sayable(name: str, plan: KeyPlan) -> list[str]:
    """Every key expression that `name` may publish on."""
    keys = [
        f"lfa/{plan.fleet}/{owner}/{topic.name}{_receiver(topic, kind)}"
        for kind, owner in voices(name, plan)
        for topic in TOPICS
        if _speaks(kind, owner, topic)
    ]
    alive = [owner for kind, owner in voices(name, plan) if owner != TRUTH_OWNER and _lives(kind, owner)]
    return keys + [f"lfa/{plan.fleet}/{owner}/alive/*" for owner in alive]


def _speaks(kind: str, owner: str, topic: Topic) -> bool:
    if owner == TRUTH_OWNER or topic.name in ("truth", "clock"):
        return owner == TRUTH_OWNER and topic.name in ("truth", "clock")
    if kind == "driver":  # hardware and FENCED under the robot's name, what it says of itself under its own
        own = topic.name in ("status", "event", "ask")
        return kind in topic.publishers and own == owner.startswith(DRIVER_PREFIX)
    return kind in topic.publishers


def _lives(kind: str, owner: str) -> bool:
    return kind != "driver" or owner.startswith(DRIVER_PREFIX)


def _receiver(topic: Topic, kind: str) -> str:
    """A lease's message names whom it is for; a gateway answers to all."""
    if topic.name != "lease":
        return ""
    return f"/{TO_ALL}" if kind == "driver" else "/*"


def hearable(name: str, plan: KeyPlan) -> list[str]:
    """What is brought to `name`: to robots all but ground truth, to everybody else all."""
    base = f"lfa/{plan.fleet}"
    if robot_id_of(name) is None:
        return [f"{base}/**"]
    plain = [f"{base}/*/{topic.name}" for topic in TOPICS if topic.name not in ("truth", "clock")]
    return [*plain, f"{base}/*/lease/*", f"{base}/*/alive/*"]


def rules(plan: KeyPlan, host: str, common_names: dict[str, str]) -> dict[str, Any]:
    """The part of Zenoh's configuration that guards the router of `host`; `common_names`: those not revoked."""
    neighbours = [host_name(other) for other in plan.hosts if other != host]
    members = [name for name in plan.at(host) if name not in neighbours]
    everything = f"lfa/{plan.fleet}/**"
    allowed = [_rule("learn", "egress", LEARN, [everything]), _rule("ask", "ingress", ASK, [everything])]
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    for name in [*members, *neighbours]:
        if name not in common_names:
            continue
        spoken = sayable(name, plan) if name in members else _through(name, plan, common_names)
        own = [_rule(f"hear-{name}", "egress", HEAR, hearable(name, plan))]
        if spoken:
            own.append(_rule(f"say-{name}", "ingress", SAY, spoken))
        allowed += own
        seen = _subjects(name, common_names[name], joins=name in members)
        subjects += seen
        policies.append({"rules": ["learn", "ask", *(r["id"] for r in own)], "subjects": [s["id"] for s in seen]})
    guard = {"enabled": True, "default_permission": "deny", "rules": allowed, "subjects": subjects}
    return {
        "access_control": guard | {"policies": policies},
        "downsampling": _floods(plan, host),
        "low_pass_filter": [_sizes(everything)],
    }


def _through(neighbour: str, plan: KeyPlan, common_names: dict[str, str]) -> list[str]:
    """What a neighbour router may pass on: what those may say who may join there.

    Its own supervisor shows the same certificate: should that one come here, it gets no more.
    """
    there = [name for name in plan.at(neighbour.removeprefix(HOST_PREFIX)) if name in common_names]
    return list(dict.fromkeys(key for name in there for key in sayable(name, plan)))


def _subjects(name: str, common_name: str, *, joins: bool) -> list[dict[str, Any]]:
    """By certificate and password over tls and quic, by password over the unix socket, whose file is 0600.

    A neighbour router that we opened the link to has shown us its certificate only.
    """
    if not joins:
        return [{"id": name, "cert_common_names": [common_name]}]
    proven = {"id": f"{name}-tls", "cert_common_names": [common_name], "usernames": [common_name]}
    return [proven, {"id": f"{name}-unix", "usernames": [common_name], "link_protocols": ["unixsock-stream"]}]


def _rule(id: str, flow: str, messages: Iterable[str], keys: list[str]) -> dict[str, Any]:
    return {"id": id, "permission": "allow", "flows": [flow], "messages": list(messages), "key_exprs": keys}


def _floods(plan: KeyPlan, host: str) -> list[dict[str, Any]]:
    """Only what robots say: a world that catches up says much at once, and its newest counts."""
    robots = [name for name in plan.places if robot_id_of(name)]
    receivers = [TO_ALL, WITNESS_NAME, *robots, *(name.replace("robot", "gateway", 1) for name in robots)]
    rates = [
        {"key_expr": f"lfa/{plan.fleet}/{name}/{topic.name}{to}", "freq": freq}
        for name in plan.at(host)
        for topic in TOPICS
        if robot_id_of(name) and "agent" in topic.publishers and (freq := _flood_hz(topic)) is not None
        for to in ([f"/{receiver}" for receiver in receivers] if topic.name == "lease" else [""])
    ]
    return [{"id": "floods", "messages": ["put"], "flows": ["ingress"], "rules": rates}] if rates else []


def _flood_hz(topic: Topic) -> float | None:
    if topic.rate_hz is None:
        return FLOOD_HZ.get(topic.name)
    return max(FLOOD_RATIO * topic.rate_hz, FLOOD_HZ_MIN)


def _sizes(everything: str) -> dict[str, Any]:
    return {
        "id": "sizes",
        "messages": ["put"],
        "flows": ["ingress"],
        "key_exprs": [everything],
        "size_limit": MESSAGE_BYTES_MAX,
    }
