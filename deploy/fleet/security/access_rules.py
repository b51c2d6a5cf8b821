"""Access rules of a secure router, derived from the table of topics and the placement of processes.

A robot publishes under its own name, and only topics whose column `publishers` names an agent; the world publishes for
the hardware that it simulates. A router admits from a neighbour router only the keys of the processes placed there: the
owner of a machine can publish as any process of that machine, and as no other (zenoh.md section 5).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from msgspec import Struct

from lfa.deploy.fleet.security.follow_rights import followable
from lfa.protocol.messages.header import MESSAGE_BYTES_MAX
from lfa.protocol.names import WITNESS_NAME, robot_id_of
from lfa.protocol.topics import (
    DRIVER_PREFIX,
    HOST_PREFIX,
    OPERATOR_NAME,
    RECORDER_NAME,
    TO_ALL,
    TO_HELLO,
    TOPICS,
    TRUTH_OWNER,
    WORLD_NAME,
    Topic,
)

FLOOD_RATIO, FLOOD_HZ_MIN = 10.0, 50.0
"""Rate limit of a topic: its ratio to the rate in the table, and its minimum [Hz]; the excess is dropped at ingress."""
FLOOD_HZ = {"lease": 2000.0, "obstacles": 500.0, "ask": 50.0, "stop_known": 100.0}
"""Rate limits [Hz] of topics published on events. Zenoh drops a message that follows the last one too soon, so a limit
is also the minimum interval on a key: no agent publishes two of these at once. `event` has no limit: two at once are
usual, and only operators read it."""
LEARN = ("declare_subscriber", "declare_queryable", "query", "liveliness_query", "declare_liveliness_subscriber")
"""Zenoh messages that tell a client about subscribers; without them it sends nothing."""
ASK = ("declare_subscriber", "query")
SEE = ("liveliness_query", "declare_liveliness_subscriber")
SAY = ("put", "liveliness_token")
HEAR = ("put", "reply", "liveliness_token")


PERSONS = (OPERATOR_NAME, RECORDER_NAME)
"""Members that are no process of one machine. Each machine has its own keys for them, beside those of the person."""


class KeyPlan(Struct, frozen=True):
    """Machines of a fleet, and the routers that each process may join."""

    fleet: str
    hosts: dict[str, tuple[str, ...]]
    """Addresses and network names of each machine."""
    places: dict[str, tuple[str, ...]]
    """Machines whose routers `robot3`, `world`, `operator`, `host-a`, .. may join, the home machine first."""

    def at(self, host: str) -> list[str]:
        """Return the names that may join the router of `host`."""
        return [name for name, hosts in self.places.items() if host in hosts]

    def kept_at(self, host: str) -> list[str]:
        """Return the names whose keys are stored on `host`: its processes, and this machine's operator and recorder.

        The keys of persons, who join from anywhere, are on no machine.
        """
        return [name for name in self.at(host) if name not in PERSONS and self.places[name][0] == host]

    def robots(self) -> list[int]:
        return [robot for name in self.places if (robot := robot_id_of(name))]

    def simulated(self) -> list[str]:
        """Return the robots whose hardware the world simulates: those without a driver."""
        robots = [name for name in self.places if robot_id_of(name)]
        return [name for name in robots if driver_of(name) not in self.places]


def stationed(person: str, host: str) -> str:
    """Return the name under which a person acts from machine `host`: `operator-a`, whose keys are on that machine."""
    return f"{person}-{host}"


def person_of(name: str) -> str | None:
    """Return `operator` or `recorder` for such a person, stationed at a machine or not; None for any other member."""
    return next((person for person in PERSONS if name == person or name.startswith(f"{person}-")), None)


def driver_of(robot: str) -> str:
    """Return the name of the driver process of a real robot: `driver3` for `robot3`."""
    return robot.replace("robot", DRIVER_PREFIX, 1)


def host_name(host: str) -> str:
    """Return the name of a machine's router and supervisor: `host-a` for machine `a`."""
    return f"{HOST_PREFIX}{host}"


def voices(name: str, plan: KeyPlan) -> list[tuple[str, str]]:
    """Return the pairs (kind in the table's `publishers`, owner of the keys) under which `name` may publish."""
    if name == WORLD_NAME:
        hardware = [("driver", robot) for robot in plan.simulated()]
        witness = [] if WITNESS_NAME in plan.places else [("witness", WITNESS_NAME)]
        return [("world", WORLD_NAME), ("world", TRUTH_OWNER), *witness, *hardware]
    if name == WITNESS_NAME:
        return [("witness", WITNESS_NAME)]
    if person_of(name) is not None:
        return [("operator", OPERATOR_NAME)] if person_of(name) == OPERATOR_NAME else []
    if name.startswith(HOST_PREFIX):
        return [("host", name)]
    if name.startswith(DRIVER_PREFIX):
        return [("driver", name), ("driver", name.replace(DRIVER_PREFIX, "robot", 1))]
    return [("agent", name)] if robot_id_of(name) else []


def sayable(name: str, plan: KeyPlan) -> list[str]:
    """Return every key expression that `name` may publish on."""
    keys = [
        f"lfa/{plan.fleet}/{owner}/{topic.name}{_receiver(topic, kind)}"
        for kind, owner in voices(name, plan)
        for topic in TOPICS
        if _speaks(kind, owner, topic)
    ]
    alive = [owner for kind, owner in voices(name, plan) if owner != TRUTH_OWNER and _has_token(kind, owner)]
    return keys + [f"lfa/{plan.fleet}/{owner}/alive/*" for owner in alive]


def _speaks(kind: str, owner: str, topic: Topic) -> bool:
    if owner == TRUTH_OWNER or topic.name in ("truth", "clock"):
        return owner == TRUTH_OWNER and topic.name in ("truth", "clock")
    if kind == "driver":  # sensors and FENCED as the robot, its own status as the driver
        own = topic.name in ("status", "event", "ask")
        return kind in topic.publishers and own == owner.startswith(DRIVER_PREFIX)
    return kind in topic.publishers


def _has_token(kind: str, owner: str) -> bool:
    return kind != "driver" or owner.startswith(DRIVER_PREFIX)


def _receiver(topic: Topic, kind: str) -> str:
    """Return the receiver's part of the key: a message on `lease` names its receiver, a gateway answers to all."""
    if topic.name != "lease":
        return ""
    return f"/{TO_ALL}" if kind == "driver" else "/*"


def hearable(name: str, plan: KeyPlan) -> list[str]:
    """Return the key expressions delivered to `name`: all except ground truth to robots, all to other processes."""
    base = f"lfa/{plan.fleet}"
    if robot_id_of(name) is None:
        return [f"{base}/**"]
    plain = [f"{base}/*/{topic.name}" for topic in TOPICS if topic.name not in ("truth", "clock")]
    return [*plain, f"{base}/*/lease/*", f"{base}/*/alive/*"]


def rules(plan: KeyPlan, host: str, common_names: dict[str, str]) -> dict[str, Any]:
    """Return the access part of the Zenoh configuration of the router of `host`; `common_names`: those not revoked."""
    neighbours = [host_name(other) for other in plan.hosts if other != host]
    members = [name for name in plan.at(host) if name not in neighbours]
    everything = f"lfa/{plan.fleet}/**"
    allowed = [
        _rule("learn", "egress", LEARN, [everything]),
        _rule("ask", "ingress", ASK, [everything]),
        _rule("see", "ingress", SEE, [f"lfa/{plan.fleet}/*/alive/*"]),
    ]
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    for name in [*members, *neighbours]:
        if name not in common_names:
            continue
        publishes = sayable(name, plan) if name in members else _through(name, plan, common_names)
        own = [_rule(f"hear-{name}", "egress", HEAR, hearable(name, plan))]
        asked = followable(name, plan.fleet, plan.robots()) if name in members else None
        if asked is not None:
            own.append(_rule(f"ask-{name}", "ingress", ASK, asked))
        if publishes:
            own.append(_rule(f"say-{name}", "ingress", SAY, publishes))
        allowed += own
        seen = _subjects(name, common_names[name], joins=name in members)
        subjects += seen
        common = ["learn", "see"] if asked is not None else ["learn", "see", "ask"]
        policies.append({"rules": [*common, *(r["id"] for r in own)], "subjects": [s["id"] for s in seen]})
    guard = {"enabled": True, "default_permission": "deny", "rules": allowed, "subjects": subjects}
    return {
        "access_control": guard | {"policies": policies},
        "downsampling": _floods(plan, host),
        "low_pass_filter": [_sizes(everything)],
    }


def _through(neighbour: str, plan: KeyPlan, common_names: dict[str, str]) -> list[str]:
    """Return the keys that a neighbour router may forward: those of the processes that may join it.

    The neighbour's supervisor shows the same certificate; if it connects here, it has the same rights.
    """
    there = [name for name in plan.at(neighbour.removeprefix(HOST_PREFIX)) if name in common_names]
    return list(dict.fromkeys(key for name in there for key in sayable(name, plan)))


def _subjects(name: str, common_name: str, *, joins: bool) -> list[dict[str, Any]]:
    """Return the subjects that identify `name`.

    A client shows certificate and password over tls and quic, and its password over the unix socket, whose file is
    0600. A neighbour router at the far end of a link opened from here has shown its certificate only.
    """
    if not joins:
        return [{"id": name, "cert_common_names": [common_name]}]
    proven = {"id": f"{name}-tls", "cert_common_names": [common_name], "usernames": [common_name]}
    return [proven, {"id": f"{name}-unix", "usernames": [common_name], "link_protocols": ["unixsock-stream"]}]


def _rule(id: str, flow: str, messages: Iterable[str], keys: list[str]) -> dict[str, Any]:
    return {"id": id, "permission": "allow", "flows": [flow], "messages": list(messages), "key_exprs": keys}


def _floods(plan: KeyPlan, host: str) -> list[dict[str, Any]]:
    """Return the rate limits, for robots only: a world that catches up sends bursts, whose newest message counts."""
    robots = [name for name in plan.places if robot_id_of(name)]
    receivers = [TO_ALL, TO_HELLO, WITNESS_NAME, *robots, *(name.replace("robot", "gateway", 1) for name in robots)]
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
