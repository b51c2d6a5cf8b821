"""Observer session with a running fleet: finding the fleet and its router, and receiving its messages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

from msgspec import Struct

from lfa.deploy.client.discovery import Running, members, one_fleet, option
from lfa.deploy.process.identity import own_processes
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.names import whole_number
from lfa.protocol.node import Local, PeerDown, PeerUp
from lfa.protocol.topics import OPERATOR_NAME, alive_key, fleet_name
from lfa.protocol.transport.bus import Arrival, Inbox, Wake
from lfa.protocol.transport.credentials import credentials
from lfa.protocol.transport.links import Links
from lfa.protocol.transport.message_bus import Decoder
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import RouterAbsent, default_endpoint
from lfa.world.description.load import Scenario, draw, load

INBOX_SIZE_MAX = 65536


class FleetAddress(Struct, frozen=True):
    """Address of a fleet: its name, its router's endpoint, and this user's agents of it that run here."""

    name: str
    endpoint: str
    team: tuple[Running, ...]
    keys: Path | None = None
    """Folder with the operator's certificate, for a fleet that requires one."""


def find(fleet: str | None, connect: str | None, keys: Path | None = None) -> FleetAddress:
    """Return the address of a fleet that runs here, or of any given by name, router and keys. Raises Refused.

    A process may know several routers, its own and those that it goes over to; `connect` is one of them or all.
    """
    running = [one for one in members() if connect in (None, one.endpoint, *one.endpoint.split(","))]
    if running and (fleet is None or any(one.fleet == fleet for one in running)):
        team = one_fleet(running, fleet)
        robots = tuple(one for one in team if one.robot)
        return FleetAddress(team[0].fleet, connect or team[0].endpoint, robots, keys or team[0].keys)
    if fleet is None:
        here = "runs on this machine" if connect is None else f"is at the router {connect}"
        raise Refused(f"no agent of yours {here}: say --fleet NAME, and --connect for another router")
    return FleetAddress(fleet, connect or default_endpoint(), (), keys)


class Subscriber:
    """Subscription to one fleet; it resubscribes after links between the fleet's routers failed and returned.

    `wait` sleeps until a message wakes it or the timeout is over.
    """

    def __init__(self, fleet: FleetAddress, bus: ZenohBus, inbox: Inbox, wake: Wake) -> None:
        self.fleet = fleet
        self.bus = bus
        self._inbox = inbox
        self._wake = wake
        self._links = Links()
        self._decoder = Decoder()
        self._tokens: set[tuple[str, int]] = set()

    @property
    def dropped(self) -> int:
        return self._inbox.dropped

    def follow(self, topics: frozenset[str], pulled: frozenset[str] = frozenset()) -> None:
        """Subscribe to exactly the key expressions `topics` (as `*/pose`); those of `pulled` are read by `pull`."""
        tokens = alive_key(self.fleet.name, "*", "*")
        self.bus.follow(frozenset(map(self._key, topics)) | {tokens}, frozenset(map(self._key, pulled)))

    def pull(self, topics: Iterable[str]) -> None:
        """Let `take` return what came on the pulled key expressions `topics` since the last call."""
        for topic in topics:
            self.bus.pull(self._key(topic))

    def _key(self, topic: str) -> str:
        return f"lfa/{self.fleet.name}/{topic}"

    def wait(self, timeout_s: float) -> None:
        self._wake.wait(timeout_s)

    def take(self) -> list[tuple[Arrival, Message]]:
        """Return the messages received since the last call; payloads that do not decode are dropped."""
        now, arrivals = clock.now(), self._inbox.take()
        for arrival in arrivals:
            if not isinstance(arrival.payload, bytes):
                self._links.see(arrival.payload, now)
                self._see_token(arrival.payload)
        if self._links.due(now):
            self.bus.resubscribe()
        return list(self._decoder.messages(arrivals))

    @property
    def living(self) -> set[str]:
        """Names with a liveliness token at the last call of `take`."""
        return {owner for owner, _ in self._tokens}

    def refuse_absent(self, what: str, wait_s: float = 0.0) -> None:
        """Raise Refused, which names what was asked for, if no process of the fleet has a token within `wait_s` [s].

        Without `wait_s` those of the last `take` count. With it, messages that come meanwhile are dropped.
        """
        until = clock.now() + wait_s
        while not self._tokens and clock.now() < until:
            self.wait(0.05)
            self.take()
        if not self._tokens:
            fleet = self.fleet
            raise Refused(f"{what}: nothing of fleet {fleet.name} is heard at {fleet.endpoint}; is the fleet running?")

    def is_alive(self, name: str) -> bool:
        """Return True if `name` had a liveliness token at the last call of `take`.

        The router is not queried: in a session that also subscribes to the tokens, some such queries return nothing.
        """
        return name in self.living

    def _see_token(self, event: Local) -> None:
        match event:
            case PeerUp():
                self._tokens.add((event.name, event.incarnation))
            case PeerDown():
                self._tokens.discard((event.name, event.incarnation))


@contextmanager
def listen(
    fleet: FleetAddress,
    topics: frozenset[str],
    *,
    every: bool = False,
    wake: Wake | None = None,
    eager: frozenset[str] = frozenset(),
) -> Iterator[Subscriber]:
    """Subscribe to the key expressions `topics` (as `*/pose`) of `fleet`. Raises Refused if no router answers.

    `every`: receive all values of state topics, not only the newest. `wake`: shared with other sources of one loop.
    `eager`: topics that wake although their receivers usually wait for their next deadline.
    """
    fleet_name(fleet.name)  # a fleet named `*` would address every fleet
    wake = wake or Wake()
    inbox = Inbox(wake, INBOX_SIZE_MAX, every=every, eager=eager)
    known = None if fleet.keys is None else credentials(fleet.keys, OPERATOR_NAME, clock.wall_ms())
    try:
        bus = ZenohBus(fleet.endpoint, inbox, credentials=known)
    except RouterAbsent:
        raise Refused(f"no router answers at {fleet.endpoint}: must be the router of fleet {fleet.name}") from None
    try:
        subscriber = Subscriber(fleet, bus, inbox, wake)
        subscriber.follow(topics)
        yield subscriber
    finally:
        bus.close()


def scenario_of_fleet(fleet: FleetAddress) -> Scenario | None:
    """Return the drawn scenario of the fleet's world, if that is one of this user's processes here; else None."""
    known = world_of_fleet(fleet)
    return None if known is None else known[0]


def _seen_from(pid: int, named: str) -> str:
    """Return the scenario named on a process's command line: a relative path begins where that process runs."""
    there = Path(f"/proc/{pid}/cwd") / named
    return str(there) if there.is_file() else named


def world_of_fleet(fleet: FleetAddress) -> tuple[Scenario, int] | None:
    """Return scenario and seed of the fleet's world, if that is one of this user's processes here; else None."""
    for identity in own_processes():
        words = list(identity.arguments)
        module = next(
            (n for n, word in enumerate(words) if word.rpartition("/")[2] in ("lfa.world.cli", "lfa-world")), None
        )
        if module is None or option(words, "--fleet", "fleet") != fleet.name:
            continue
        named = next((word for word in words[module + 1 :] if not word.startswith("-")), "")
        overrides = [after for word, after in pairwise(words) if word == "--set"]
        overrides += [word.removeprefix("--set=") for word in words if word.startswith("--set=")]
        seed = whole_number(option(words, "--seed", "0")) or 0
        try:
            return draw(
                load(_seen_from(identity.pid, named), overrides, whole_number(option(words, "--robots", ""))), seed
            ), seed
        except (Refused, ValueError):
            return None
    return None
