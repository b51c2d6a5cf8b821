"""View of a fleet from any of its machines: its routers, the status of its supervisors, and orders to them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from msgspec import Struct

from lfa.deploy.client.fleet_state import FleetState
from lfa.deploy.client.session import FleetAddress, Subscriber, listen
from lfa.deploy.fleet.host.ledger import GUARDIAN, SUPERVISOR
from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.fleet.plan.fleet_file import FleetPlan, load
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.fleet.security.private_files import ISSUED
from lfa.deploy.process.identity import own_processes
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.fleet import HostOrder, HostStatus, LogLines
from lfa.protocol.messages.team import Ask
from lfa.protocol.outbox import Outbox
from lfa.protocol.topics import HOST_PREFIX, OPERATOR_NAME
from lfa.protocol.transport.message_bus import send

TOPICS = frozenset({"*/host", "*/log", "*/pose", "*/tracking", "*/status", "*/event"})
SAY_S = 0.4
POLL_S = 0.02
SILENT_S = 3.0


class Seen(Struct, frozen=True):
    """A fleet that a command addresses, and how to reach it."""

    name: str
    endpoint: str
    hosts: tuple[str, ...]
    """Names of its machines; empty: unknown."""
    part: HostPlan | None = None
    """Plan of this machine, if it belongs to the fleet."""
    plan: FleetPlan | None = None
    keys: Path | None = None
    """Folder of the operator's certificate, for a fleet that requires one."""


def find(file: Path | None, fleet: str | None, connect: str | None) -> Seen:
    """Find a fleet by its file, by its supervisor on this machine, or by name and router. Raises Refused."""
    if file is not None:
        plan = load(file)
        own = next((part for part in here() if part.fleet == plan.name), None)
        far = ",".join(host_plan.door(plan, name) for name in plan.hosts)
        endpoint = connect or (own.endpoint if own is not None else far)
        own_keys = _keys(own) or (host_plan.store(plan) / ISSUED if (host_plan.store(plan) / ISSUED).is_dir() else None)
        return Seen(plan.name, endpoint, tuple(plan.hosts), own, plan, own_keys)
    own_all = [part for part in here() if fleet in (None, part.fleet)]
    if connect is not None:
        if fleet is None:
            raise Refused("--connect needs the fleet's name as well: --fleet NAME")
        return Seen(fleet, connect, ())
    names = sorted({part.fleet for part in own_all})
    if not names:
        which = "no fleet" if fleet is None else f"no fleet {fleet!r}"
        raise Refused(f"{which} has a supervisor here: give its fleet file, or --fleet NAME --connect ENDPOINT")
    if len(names) > 1:
        raise Refused(f"several fleets run here: say --fleet {' or --fleet '.join(names)}")
    return Seen(names[0], own_all[0].endpoint, own_all[0].hosts, own_all[0], None, _keys(own_all[0]))


def _keys(part: HostPlan | None) -> Path | None:
    return part.folder / host_plan.KEYS if part is not None and part.keyed else None


def here() -> list[HostPlan]:
    """Return the plans of this user's supervisors on this machine; a guardian is about to start one."""
    paths = {one.arguments[-1] for one in own_processes() if {SUPERVISOR, GUARDIAN} & set(one.arguments[:-1])}
    found = []
    for path in sorted(paths):
        with suppress(Refused):
            found.append(host_plan.read(Path(path)))
    return found


class FleetView:
    """State of a fleet from the newest messages of its hosts and robots, updated by `hear`."""

    def __init__(self, subscriber: Subscriber, seen: Seen) -> None:
        self._subscriber = subscriber
        self.seen = seen
        self._outbox = Outbox(seen.name, OPERATOR_NAME, incarnations.drawn(), first=1)
        self._state = FleetState()

    @property
    def hosts(self) -> dict[str, HostStatus]:
        """Last status of each machine, by name."""
        return {name: heard.message for name, heard in self._state.hosts.items()}

    @property
    def texts(self) -> dict[str, str]:
        """Status text of each robot, by name."""
        return {name: heard.message.text for name, heard in self._state.status.items()}

    @property
    def refused(self) -> dict[str, int]:
        """Number of messages and tokens that all robots together refused of a member for its rates, by its name."""
        return self._state.refused()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the machines: from the fleet's file, else all with a liveliness token or a received status."""
        there = {name.removeprefix(HOST_PREFIX) for name in self._subscriber.living if name.startswith(HOST_PREFIX)}
        return self.seen.hosts or tuple(sorted(there | self.hosts.keys()))

    def hear(self) -> list[tuple[float, Message]]:
        """Take in all received messages and return them with their arrival times [s]."""
        heard = []
        for arrival, message in self._subscriber.take():
            heard.append((arrival.at, message))
            self._state.update(arrival.at, message)
        return heard

    def silent(self, now: float) -> list[str]:
        """Return the machines without a status in the last SILENT_S."""
        heard = self._state.hosts
        return [name for name in self.names if name not in heard or now - heard[name].at >= SILENT_S]

    def host_of(self, process: str) -> str | None:
        for name, status in self.hosts.items():
            if any(report.name == process for report in status.processes):
                return name
        return None

    def order(self, action: str, target: str = "", lines: int = 0) -> HostOrder:
        """Return a new order with its own sequence number; repeat it by `say` until it is obeyed."""
        return HostOrder(self._outbox.header("order", clock.now()), action, target, lines)

    def ask(self, what: str) -> None:
        """Ask the fleet to publish `what`, such as its roster."""
        send(self._subscriber.bus, self._outbox.envelope("ask", Ask(self._outbox.header("ask", clock.now()), what)))

    def say(self, order: HostOrder) -> None:
        send(self._subscriber.bus, self._outbox.envelope("order", order))

    def obeyed(self, order: HostOrder, host: str) -> bool:
        """Return True if the last status of `host` confirms the order."""
        status = self.hosts.get(host)
        return status is not None and status.obeyed == (order.header.incarnation, order.header.seq)

    def say_until(
        self,
        order: HostOrder,
        holds: Callable[[], bool],
        within_s: float,
        see: Callable[[float, Message], None] = lambda _at, _message: None,
    ) -> bool:
        """Publish `order` every SAY_S until `holds()`; return False if that takes longer than `within_s` [s].

        `see` receives every message that arrives meanwhile, with its arrival time [s].
        """
        until, say_at = clock.now() + within_s, 0.0
        while not holds():
            now = clock.now()
            if now > until:
                return False
            if now >= say_at:
                say_at = now + SAY_S
                self.say(order)
            clock.sleep(POLL_S)
            for at, message in self.hear():
                see(at, message)
        return True

    def living(self, host: str) -> bool:
        return self._subscriber.is_alive(f"{HOST_PREFIX}{host}")


@contextmanager
def open_view(seen: Seen, topics: frozenset[str] = TOPICS) -> Iterator[FleetView]:
    """Open a session and provide a view of the fleet. Raises Refused when no router answers."""
    with listen(FleetAddress(seen.name, seen.endpoint, (), seen.keys), topics) as subscriber:
        yield FleetView(subscriber, seen)


def await_first_status(view: FleetView, within_s: float) -> None:
    """Wait until every known host has reported its status, for at most `within_s` [s]."""
    order = view.order("report")
    view.say_until(order, lambda: bool(view.names) and all(view.obeyed(order, n) for n in view.names), within_s)


__all__ = ["FleetView", "LogLines", "Seen", "await_first_status", "find", "here", "open_view"]
