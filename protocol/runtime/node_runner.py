"""The real-time loop around Nodes: bus, clock, signals, journal. Agent, world, witness and drivers all run in it.

The loop waits for an urgent arrival or the next deadline, delivers the arrivals, ticks the due nodes, publishes their
answers, and writes the journals once. It makes no other decision.
"""

from __future__ import annotations

import signal
import sys
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from types import FrameType

from msgspec import Struct

from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.team import OperatorNote
from lfa.protocol.node import Local, Node, Stop, defers_rounds, lacks_messages, reborn, waits_for
from lfa.protocol.output import write_line
from lfa.protocol.runtime import log_capture
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.runtime.namesakes import refuse_double, refuse_twin
from lfa.protocol.runtime.node_host import NodeHost, Sent
from lfa.protocol.runtime.systemd import Notify
from lfa.protocol.runtime.vital_signs import VitalSigns, keep_one_heap, settle
from lfa.protocol.topics import OPERATOR_NAME, key, matches
from lfa.protocol.transport.bus import Arrival, Inbox, Tokens, Wake
from lfa.protocol.transport.credentials import Credentials
from lfa.protocol.transport.link_model import LINK_CONDITIONS, Reception
from lfa.protocol.transport.links import Links
from lfa.protocol.transport.message_bus import Decoder
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import LINK_LEASE_MS, RouterAbsent

CONNECT_RETRY_S = 0.2
STOP_GRACE_S = 0.7  # for final messages: a fence round trip or the residual motion, in any profile
WAIT_S_MAX = 0.5
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


_ENDING, _OF_TERMINALS = (signal.SIGTERM, signal.SIGINT), (signal.SIGHUP, signal.SIGQUIT)
"""Signals that end a process in order: a driver whose terminal is closed has to stop its wheels, too."""


class _NodeRunner:
    """One node in the loop, with its session, inbox, node host and current subscriptions."""

    def __init__(self, node: Node, bus: ZenohBus, inbox: Inbox, journal: Journal, conditions_key: str | None) -> None:
        """`conditions_key` is the key of an operator's link conditions, None if they are not to be applied."""
        self.node = node
        self.host = NodeHost(node, journal)
        self.bus = bus
        self.inbox = inbox
        self._followed: frozenset[str] | None = None
        self._conditions_key = conditions_key
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
        for arrival in self._through_links(now):
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
        self._links.lacks(lacks_messages(node), now)
        if not self._follow() and self._links.due(now):
            self.bus.resubscribe()
        host.journal.flush()
        self.inbox.defer_grants, self.inbox.defer_rounds = node.defer_grants, defers_rounds(node)
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
        self.bus.follow(wanted | self._conditions_interest(wanted))
        return True

    def _conditions_interest(self, interests: frozenset[str]) -> frozenset[str]:
        """Return the key of link conditions; empty if not applied or if the node subscribes to operators anyway."""
        wanted = self._conditions_key
        heard = wanted is None or any(matches(interest, wanted) for interest in interests)
        return frozenset() if wanted is None or heard else frozenset({wanted})

    def _through_links(self, now: float) -> list[Arrival]:
        """Return the arrivals after the link model; an operator's link conditions are applied and not passed on."""
        arrivals = self._tokens.debounce(self.inbox.take(), now)
        if self._conditions_key is None:
            return arrivals
        if self._reception.is_clear and self._conditions_key not in [arrival.key for arrival in arrivals]:
            return arrivals
        for arrival in arrivals:
            if arrival.key != self._conditions_key or not self._obeys_conditions(arrival):
                self._reception.put(arrival)
        return self._reception.take(max([now, *(arrival.at for arrival in arrivals)]))

    def _obeys_conditions(self, arrival: Arrival) -> bool:
        note = Decoder().message(arrival)
        return (
            isinstance(note, OperatorNote)
            and note.command == LINK_CONDITIONS
            and self._reception.link_model.obey(note.arguments)
        )

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
                log_capture.tell(to, payload, clock.wall_ms())


def run(nodes: Sequence[Node], options: Options, floor: int) -> int:
    """Run `nodes` in this process until all are finished; return the exit code: 0, or 130 after Ctrl-C.

    Waits for a router without a time limit. Raises Refused (exit code 2) if a node cannot take part, or if its name
    already runs in the fleet.
    """
    keep_one_heap()
    wake = Wake()
    stop = _on_signals(wake)
    runners: list[_NodeRunner] = []
    name = nodes[0].name
    try:
        for node in nodes:
            inbox = Inbox(wake, defer_hellos=node.defer_hellos)
            bus = connect(options, inbox, stop)
            if bus is None:
                write_line(f"{name}: ended, {stop.why}, before a router was there", sys.stdout)
                return stop.code
            try:
                runners.append(_joined(node, bus, inbox, options, floor))
            except Refused:
                bus.close()
                raise
        settle()
        write_line(f"{name}: ready, in fleet {options.fleet} at {options.endpoint}", sys.stdout)
        _loop(runners, wake, stop, Notify(options.notify), lambda runner, node: _reborn(runner, node, options, floor))
        write_line(f"{name}: ended, {stop.why}", sys.stdout)
        return stop.code
    finally:
        for runner in runners:
            runner.bus.close()
            runner.host.journal.close()


def connect(options: Options, inbox: Inbox, stop: _StopRequest) -> ZenohBus | None:
    """Wait for a router and return a session with it; None if a stop is requested meanwhile."""
    reported = False
    while not stop.requested:
        try:
            return ZenohBus(options.endpoint, inbox, options.lease_ms, options.credentials)
        except RouterAbsent:
            if not reported:
                why = "" if options.credentials is None else f", or none that lets {options.credentials.name} in"
                text = f"no router at {options.endpoint}{why}: waiting for one (start it with: lfa-router)"
                write_line(text, sys.stderr)
                reported = True
            Notify(options.notify).alive()
            stop.wake.wait(CONNECT_RETRY_S)
    return None


def _joined(node: Node, bus: ZenohBus, inbox: Inbox, options: Options, floor: int) -> _NodeRunner:
    """Announce `node`, whose name must not run in the fleet, and return its place in the loop. Raises Refused."""
    lease_s = options.lease_ms / 1000.0
    dead = refuse_double(bus, inbox, options.fleet, lease_s, node)
    started_with = {"fleet": options.fleet, **node.started_with}
    heading = Heading(JOURNAL_VERSION, node.name, node.incarnation, floor, started_with)
    conditions_key = key(options.fleet, OPERATOR_NAME, "operator") if options.faults else None
    runner = _NodeRunner(node, bus, inbox, Journal(options.journal, heading), conditions_key)
    bus.announce(options.fleet, node.name, node.incarnation)
    refuse_twin(bus, inbox, options.fleet, lease_s, node, dead)
    return runner


def _reborn(runner: _NodeRunner, node: Node, options: Options, floor: int) -> _NodeRunner:
    """Replace the node in `runner` by `node`, which has the same name and a later number (E23); say so in one line.

    Raises Refused if a process of this name speaks: then the later incarnation runs elsewhere, and this one is left.
    """
    why = f"the fleet knows a later incarnation than {runner.node.incarnation} (was the clock set back?)"
    write_line(f"{node.name}: {why}: goes on as {node.incarnation}, at the tail", sys.stderr)
    runner.host.journal.close()
    runner.bus.withdraw()
    runner.bus.follow(frozenset())
    runner.inbox.take()
    return _joined(node, runner.bus, runner.inbox, options, floor)


def _loop(
    runners: list[_NodeRunner],
    wake: Wake,
    stop: _StopRequest,
    notify: Notify,
    replaced: Callable[[_NodeRunner, Node], _NodeRunner],
) -> None:
    began = now = clock.now()
    notify.ready()
    stop_by = None
    vitals = VitalSigns(now)
    waited_for = None
    while True:
        deadline = min([runner.next_deadline() for runner in runners])
        wake.wait(min(max(deadline - clock.now(), 0.0), WAIT_S_MAX))
        now = clock.now()
        for place, runner in enumerate(runners):
            vitals.lag(min(runner.step(now), now - began))  # a first deadline may lie far in the past
            later = reborn(runner.node)
            if later is not None and not stop.requested:
                runners[place] = replaced(runner, later)
        if vitals.due(now):
            notify.alive()
            waited_for = _say_waits(runners[0].node, waited_for)
            for runner in runners:
                inbox = runner.inbox
                measured = vitals.of(inbox.dropped, runner.host.undecodable, runner.tick_p99_s(), inbox.refused)
                runner.tell(measured, now)
        if stop.requested and stop_by is None:
            stop_by = now + STOP_GRACE_S
            for runner in runners:
                runner.tell(Stop(), now)
        if _is_over(runners) or (stop_by is not None and now > stop_by):
            return


def _say_waits(node: Node, before: str | None) -> str | None:
    """Write what `node` waits for when that is something else than `before`, and return it."""
    missing = waits_for(node)
    if missing != before:
        write_line(f"{node.name}: {'waits for ' + missing if missing else 'all are there'}", sys.stdout)
    return missing


def _is_over(runners: Sequence[_NodeRunner]) -> bool:
    """Return True if all nodes have finished. Raises Refused if one of them cannot take part."""
    over = True
    for runner in runners:
        if runner.node.refusal is not None:
            raise Refused(runner.node.refusal)
        over = over and runner.node.finished
    return over


class _StopRequest:
    """Flag that a signal has requested the end of this process; the signal also wakes the loop."""

    def __init__(self, wake: Wake) -> None:
        self.wake = wake
        self.requested = False
        self.signal: signal.Signals | None = None

    @property
    def why(self) -> str:
        """Reason of the end, as text."""
        return "finished" if self.signal is None else "by Ctrl-C" if self.code else f"by {self.signal.name}"

    @property
    def code(self) -> int:
        """Exit code: 130 after Ctrl-C, as of every program; 0 after SIGTERM, which a supervisor sends."""
        return 130 if self.signal is signal.SIGINT else 0


def _on_signals(wake: Wake) -> _StopRequest:
    stop = _StopRequest(wake)

    def order(signum: int, _frame: FrameType | None) -> None:
        stop.requested, stop.signal = True, signal.Signals(signum)
        wake.set()

    heeded = [number for number in _OF_TERMINALS if signal.getsignal(number) != signal.SIG_IGN]  # nohup ignores one
    for number in (*_ENDING, *heeded):
        signal.signal(number, order)
    return stop
