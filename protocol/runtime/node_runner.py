"""The real-time loop around Nodes: bus, clock, signals, journal. Agent, world, witness and drivers all run in it.

The loop waits for an urgent arrival or the next deadline, delivers the arrivals, ticks the due nodes, publishes their
answers, and writes the journals once. It makes no other decision.
"""

from __future__ import annotations

import ctypes
import gc
import resource
import signal
import sys
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from random import Random
from types import FrameType

from msgspec import Struct

from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import BadMessage, decode
from lfa.protocol.messages.team import OperatorNote
from lfa.protocol.names import WITNESS_NAME, robot_id_of
from lfa.protocol.node import Local, Node, Stop, Vitals
from lfa.protocol.runtime import log_capture
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.runtime.node_host import NodeHost, Sent
from lfa.protocol.runtime.systemd import Notify
from lfa.protocol.topics import OPERATOR_NAME, TOPIC, address, key, matches
from lfa.protocol.transport.bus import Arrival, Inbox, Links, Tokens, Wake
from lfa.protocol.transport.credentials import Credentials
from lfa.protocol.transport.link_model import WEATHER, Reception
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import LINK_LEASE_MS, RouterAbsent

CONNECT_RETRY_S = 0.2
STOP_GRACE_S = 0.7  # for final messages: a fence round trip or the residual motion, in any profile
VITALS_S = 1.0
NAMESAKE_LEASES = 1.75  # of the two that are waited: a process that waits for its mission publishes only once a second
TWIN_LEASES = 1.5
WAIT_S_MAX = 0.5
M_ARENA_MAX = -8  # malloc.h
TICKS_KEPT = 1000
"""Number of tick durations kept, 20 s of control: ten of them lie above the 99th percentile."""


class Options(Struct, frozen=True):
    """Options with which a process joins its fleet."""

    fleet: str
    endpoint: str
    """Endpoint of the router; or several, `a,b`: the first that answers is used."""
    journal: Path | None = None
    faults: bool = False
    """Apply link conditions set by an operator: loss and delay, simulated at the receiver."""
    lease_ms: int = LINK_LEASE_MS
    credentials: Credentials | None = None
    notify: str = ""
    """Socket of systemd (NOTIFY_SOCKET); empty: none."""


class _NodeRunner:
    """One node in the loop, with its session, inbox, node host and current subscriptions."""

    def __init__(self, node: Node, bus: ZenohBus, inbox: Inbox, journal: Journal, weather_key: str | None) -> None:
        """`weather_key` is the key of an operator's link conditions, None if they are not to be applied."""
        self.node = node
        self.host = NodeHost(node, journal)
        self.bus = bus
        self.inbox = inbox
        self._followed: frozenset[str] | None = None
        self._weather_key = weather_key
        self._tokens = Tokens()
        self._links = Links()
        self._ticks_s: deque[float] = deque(maxlen=TICKS_KEPT)
        self._reception = Reception(node.name, Random(f"air-{node.name}-{node.incarnation}"))

    def next_deadline(self) -> float:
        wire = min(self._reception.next_due(), self._tokens.next_due(), self._links.anew_at)
        return min(self.node.next_deadline(), wire)

    def step(self, now: float) -> float:
        """Deliver the arrivals and tick if due; return the lateness of the tick [s], negative if none was due."""
        host, node = self.host, self.node
        for arrival in self._through_the_air(now):
            if isinstance(arrival.payload, bytes):
                self._publish(host.message(arrival.at, arrival.key, arrival.payload))
            else:
                self._links.see(arrival.payload, now)
                self._publish(host.deliver(arrival.at, "", arrival.payload, b""))
        self._follow()  # before the node asks: an immediate answer would be missed
        late = now - node.next_deadline()
        if late >= 0.0:
            before_s = clock.thread_s()
            sent = host.tick(clock.now())
            self._ticks_s.append(clock.thread_s() - before_s)
            self._publish(sent)
        if not self._follow() and self._links.due(now):
            self.bus.resubscribe()
        host.journal.flush()
        self.inbox.defer_grants = getattr(node, "defer_grants", False)  # only a robot ever leads
        return late

    def tick_p99_s(self) -> float:
        """Return the processor time [s] of a tick, 99th percentile of the newest TICKS_KEPT; 0 before the first."""
        ordered = sorted(self._ticks_s)
        return ordered[int(0.99 * len(ordered))] if ordered else 0.0

    def _follow(self) -> bool:
        """Subscribe to the node's interests; return True if they have changed."""
        wanted = self.node.interests
        if wanted is self._followed:
            return False
        self._followed = wanted
        self.bus.follow(wanted | self._weather_interest(wanted))
        return True

    def _weather_interest(self, interests: frozenset[str]) -> frozenset[str]:
        """Return the key of link conditions; empty if not applied or if the node subscribes to operators anyway."""
        wanted = self._weather_key
        heard = wanted is None or any(matches(interest, wanted) for interest in interests)
        return frozenset() if wanted is None or heard else frozenset({wanted})

    def _through_the_air(self, now: float) -> list[Arrival]:
        """Return the arrivals after the link model; an operator's link conditions are applied and not passed on."""
        arrivals = self._tokens.debounce(self.inbox.take(), now)
        if self._weather_key is None:
            return arrivals
        if self._reception.is_clear and self._weather_key not in [arrival.key for arrival in arrivals]:
            return arrivals
        for arrival in arrivals:
            if arrival.key != self._weather_key or not self._is_weather(arrival):
                self._reception.put(arrival)
        return self._reception.take(max([now, *(arrival.at for arrival in arrivals)]))

    def _is_weather(self, arrival: Arrival) -> bool:
        try:
            note = decode(arrival.payload, OperatorNote) if isinstance(arrival.payload, bytes) else None
        except BadMessage:
            return False
        return isinstance(note, OperatorNote) and note.command == WEATHER and self._reception.air.obey(note.arguments)

    def tell(self, event: Local, now: float) -> None:
        """Deliver a local event to the node."""
        self._publish(self.host.deliver(now, "", event, b""))

    def _publish(self, sent: Sent) -> None:
        if sent:
            self.host.journal.flush()  # first: a receiver may outlive us, and the journal must explain the message
        for to, payload in sent:
            self.bus.publish(to, payload)
        for to, payload in sent:
            if to.endswith(log_capture.EVENT_ENDING):
                log_capture.tell(payload, clock.wall_ms())


def run(nodes: Sequence[Node], options: Options, floor: int) -> int:
    """Run `nodes` in this process until all are finished; return the exit code 0.

    Waits for a router without a time limit. Raises Refused (exit code 2) if a node cannot take part, or if its name
    already runs in the fleet.
    """
    _libc("mallopt", M_ARENA_MAX, 1)  # one heap, not one for each of Zenoh's threads
    wake = Wake()
    stop = _on_signals(wake)
    seats: list[_NodeRunner] = []
    weather_key = key(options.fleet, OPERATOR_NAME, "operator") if options.faults else None
    try:
        for node in nodes:
            inbox = Inbox(wake, defer_hellos=node.name != WITNESS_NAME)
            bus = connect(options, inbox, stop)
            if bus is None:
                return 0
            dead = _refuse_double(bus, inbox, options, node)
            started_with = {"fleet": options.fleet, **node.started_with}
            heading = Heading(JOURNAL_VERSION, node.name, node.incarnation, floor, started_with)
            seats.append(_NodeRunner(node, bus, inbox, Journal(options.journal, heading), weather_key))
            bus.announce(options.fleet, node.name, node.incarnation)
            _refuse_twin(bus, options, node, dead)
        gc.collect()
        gc.freeze()
        _libc("malloc_trim", 0)  # memory that the start used and freed
        return _loop(seats, wake, stop, Notify(options.notify))
    finally:
        for seat in seats:
            seat.bus.close()
            seat.host.journal.close()


def connect(options: Options, inbox: Inbox, stop: _StopRequest) -> ZenohBus | None:
    """Wait for a router and return a session with it; None if a stop is requested meanwhile."""
    told = False
    while not stop.told:
        try:
            return ZenohBus(options.endpoint, inbox, options.lease_ms, options.credentials)
        except RouterAbsent:
            if not told:
                why = "" if options.credentials is None else f", or none that lets {options.credentials.name} in"
                print(
                    f"no router at {options.endpoint}{why}: waiting for one (start it with: lfa-router)",
                    file=sys.stderr,
                    flush=True,
                )
                told = True
            stop.wake.wait(CONNECT_RETRY_S)
    return None


def _loop(seats: Sequence[_NodeRunner], wake: Wake, stop: _StopRequest, notify: Notify) -> int:
    began = now = clock.now()
    notify.ready()
    stop_by = None
    vitals = _VitalSigns(now)
    while True:
        deadline = min([seat.next_deadline() for seat in seats])
        wake.wait(min(max(deadline - clock.now(), 0.0), WAIT_S_MAX))
        now = clock.now()
        for seat in seats:
            vitals.lag(min(seat.step(now), now - began))  # a first deadline may lie far in the past
        if vitals.due(now):
            notify.alive()
            for seat in seats:
                seat.tell(vitals.of(seat), now)
        if stop.told and stop_by is None:
            stop_by = now + STOP_GRACE_S
            for seat in seats:
                seat.tell(Stop(), now)
        if _is_over(seats) or (stop_by is not None and now > stop_by):
            return 0


def _is_over(seats: Sequence[_NodeRunner]) -> bool:
    """Return True if all nodes have finished. Raises Refused if one of them cannot take part."""
    over = True
    for seat in seats:
        if seat.node.refusal is not None:
            raise Refused(seat.node.refusal)
        over = over and seat.node.finished
    return over


class _StopRequest:
    """Flag that a signal has requested the end of this process; the signal also wakes the loop."""

    def __init__(self, wake: Wake) -> None:
        self.wake = wake
        self.told = False


def _on_signals(wake: Wake) -> _StopRequest:
    stop = _StopRequest(wake)

    def order(_signum: int, _frame: FrameType | None) -> None:
        stop.told = True
        wake.set()

    signal.signal(signal.SIGTERM, order)
    signal.signal(signal.SIGINT, order)
    return stop


def _refuse_double(bus: ZenohBus, inbox: Inbox, options: Options, node: Node) -> list[int]:
    """Wait two link leases for the token of an earlier incarnation of this name to vanish.

    Returns the incarnations whose tokens remain but that are silent, hence presumed dead. Raises Refused if one of them
    still publishes.
    """
    fleet, lease_s = options.fleet, options.lease_ms / 1000.0
    dead = bus.living(fleet, node.name)
    if not dead:
        return []
    bus.follow(frozenset({f"lfa/{fleet}/{node.name}/**"}))
    heard: dict[int, float] = {}
    patience_until = clock.now() + 2.0 * lease_s
    while clock.now() < patience_until:
        clock.sleep(0.05)
        heard.update(_speakers(inbox))
        dead = bus.living(fleet, node.name)
        if not dead:
            break
    else:
        if any(at > clock.now() - NAMESAKE_LEASES * lease_s for at in heard.values()):
            raise _double(fleet, node)
    bus.follow(frozenset())
    inbox.take()
    return dead


def _refuse_twin(bus: ZenohBus, options: Options, node: Node, dead: list[int]) -> None:
    """Resolve two simultaneous starts of one name, which see each other only after announcing: the younger gives way.

    Neither publishes meanwhile, so only tokens count. The older waits long enough for the younger to leave first.
    Raises Refused if another incarnation remains.
    """

    def twins() -> list[int]:
        return [life for life in bus.living(options.fleet, node.name) if life not in (node.incarnation, *dead)]

    found = twins()
    if not found:
        return
    leases = TWIN_LEASES if min(found) < node.incarnation else 2.0 * TWIN_LEASES
    patience_until = clock.now() + leases * options.lease_ms / 1000.0
    while clock.now() < patience_until:
        clock.sleep(0.05)
        if not twins():
            return
    raise _double(options.fleet, node)


def _double(fleet: str, node: Node) -> Refused:
    other = "--id" if robot_id_of(node.name) else "--fleet"
    return Refused(f"{node.name} already runs in fleet {fleet!r}: end that one, or give another {other}")


def _speakers(inbox: Inbox) -> dict[int, float]:
    """Return the incarnations that sent a well-formed message, with the arrival time [s] of the last one."""
    heard: dict[int, float] = {}
    for arrival in inbox.take():
        where = address(arrival.key)
        if where is None or where.topic not in TOPIC or not isinstance(arrival.payload, bytes):
            continue
        try:
            message = decode(arrival.payload, TOPIC[where.topic].type)
        except BadMessage:
            continue
        if message.header.sender == where.owner:
            heard[message.header.incarnation] = arrival.at
    return heard


class _VitalSigns:
    """Measurement of the process's own lag, processor share and memory, once a second."""

    def __init__(self, now: float) -> None:
        self._since = now
        self._cpu_s = clock.cpu_s()
        self._lag_s = 0.0
        self._cpu_percent = 0.0

    def lag(self, late_s: float) -> None:
        self._lag_s = max(self._lag_s, late_s)

    def due(self, now: float) -> bool:
        if now < self._since + VITALS_S:
            return False
        cpu_s = clock.cpu_s()
        self._cpu_percent = 100.0 * (cpu_s - self._cpu_s) / (now - self._since)
        self._since, self._cpu_s = now, cpu_s
        return True

    def of(self, seat: _NodeRunner) -> Vitals:
        lag_s, self._lag_s = self._lag_s, 0.0
        dropped, undecodable = seat.inbox.dropped, seat.host.undecodable
        return Vitals(lag_s, dropped, undecodable, self._cpu_percent, _resident_mib(), seat.tick_p99_s())


def _libc(name: str, *numbers: int) -> None:
    """Call a memory-saving function of glibc; do nothing with another C library."""
    function = getattr(ctypes.CDLL(None), name, None)
    if function is not None:
        function(*numbers)


def _resident_mib() -> float:
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return pages * resource.getpagesize() / 2**20
