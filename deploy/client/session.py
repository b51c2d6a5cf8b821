"""Looking at a running fleet: which one, where its router is, and what comes from it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from msgspec import Struct

from lfa.deploy.client.discovery import Running, agents, one_fleet, option
from lfa.deploy.process.identity import own_processes
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import BadMessage, Message, decode
from lfa.protocol.node import Local, PeerDown, PeerUp
from lfa.protocol.topics import OPERATOR_NAME, TOPIC, address, alive_key, fleet_name
from lfa.protocol.transport.bus import Arrival, Inbox, Links, Wake
from lfa.protocol.transport.credentials import credentials
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import RouterAbsent, default_endpoint
from lfa.world.description.load import Scenario, draw, load

INBOX_SIZE_MAX = 65536


class FleetAddress(Struct, frozen=True):
    """A fleet, the endpoint where it meets, and those of its agents that are this user's own and run here."""

    name: str
    endpoint: str
    team: tuple[Running, ...]
    keys: Path | None = None
    """Folder with the operator's certificate, for a fleet that wants to see one."""


def find(fleet: str | None, connect: str | None, keys: Path | None = None) -> FleetAddress:
    """The fleet that is meant: one that runs here, or any by its name, its router and its keys. Raises Refused."""
    running = agents()
    if connect is None and running and (fleet is None or any(agent.fleet == fleet for agent in running)):
        team = one_fleet(running, fleet)
        return FleetAddress(team[0].fleet, team[0].endpoint, tuple(team), keys or team[0].keys)
    if fleet is None:
        raise Refused("no agent of yours runs on this machine: say --fleet NAME, and --connect for another router")
    return FleetAddress(fleet, connect or default_endpoint(), (), keys)


class Subscriber:
    """What comes from one fleet, also after links between its routers went and came back.

    `wait` sleeps until something wakes it or the time is over.
    """

    def __init__(self, fleet: FleetAddress, bus: ZenohBus, inbox: Inbox, wake: Wake) -> None:
        self.fleet = fleet
        self.bus = bus
        self._inbox = inbox
        self._wake = wake
        self._links = Links()
        self._tokens: set[tuple[str, int]] = set()

    @property
    def dropped(self) -> int:
        return self._inbox.dropped

    def wait(self, timeout_s: float) -> None:
        self._wake.wait(timeout_s)

    def take(self) -> list[tuple[Arrival, Message]]:
        """What has come since the last call; what is no message of ours is left out."""
        now, arrivals = clock.now(), self._inbox.take()
        for arrival in arrivals:
            if not isinstance(arrival.payload, bytes):
                self._links.see(arrival.payload, now)
                self._see_token(arrival.payload)
        if self._links.due(now):
            self.bus.resubscribe()
        found = ((arrival, _message(arrival)) for arrival in arrivals)
        return [(arrival, message) for arrival, message in found if message is not None]

    @property
    def living(self) -> set[str]:
        """Whose tokens stood when `take` was last called."""
        return {owner for owner, _ in self._tokens}

    def lives(self, name: str) -> bool:
        """Whether a token of `name` stood when `take` was last called.

        Not asked of the router: of a session that follows the tokens too, some such questions come back empty.
        """
        return name in self.living

    def _see_token(self, event: Local) -> None:
        match event:
            case PeerUp():
                self._tokens.add((event.name, event.incarnation))
            case PeerDown():
                self._tokens.discard((event.name, event.incarnation))


@contextmanager
def listen(fleet: FleetAddress, topics: frozenset[str], *, every: bool = False) -> Iterator[Subscriber]:
    """An ear for the key expressions `topics` (`*/pose`) of `fleet`; `every`: all values of states, not the newest."""
    fleet_name(fleet.name)  # what is said to `*` would be said to every fleet
    wake = Wake()
    inbox = Inbox(wake, INBOX_SIZE_MAX, every=every)
    known = None if fleet.keys is None else credentials(fleet.keys, OPERATOR_NAME, clock.wall_ms())
    try:
        bus = ZenohBus(fleet.endpoint, inbox, credentials=known)
    except RouterAbsent:
        raise Refused(f"no router answers at {fleet.endpoint}: must be the router of fleet {fleet.name}") from None
    try:
        bus.follow(frozenset(f"lfa/{fleet.name}/{topic}" for topic in topics) | {alive_key(fleet.name, "*", "*")})
        yield Subscriber(fleet, bus, inbox, wake)
    finally:
        bus.close()


def _message(arrival: Arrival) -> Message | None:
    where = address(arrival.key)
    topic = TOPIC.get(where.topic) if where is not None else None
    if topic is None or not isinstance(arrival.payload, bytes):
        return None
    try:
        return decode(arrival.payload, topic.type)
    except BadMessage:
        return None


def scenario_of_fleet(fleet: FleetAddress) -> Scenario | None:
    """The scenario that the fleet's world was started with, when that is one of this user's processes here."""
    for identity in own_processes():
        words = list(identity.arguments)
        module = next(
            (n for n, word in enumerate(words) if word.rpartition("/")[2] in ("lfa.world.cli", "lfa-world")), None
        )
        if module is None or option(words, "--fleet", "fleet") != fleet.name:
            continue
        named = next((word for word in words[module + 1 :] if not word.startswith("-")), "")
        try:
            return draw(load(named), int(option(words, "--seed", "0")))
        except (Refused, ValueError):
            return None
    return None
