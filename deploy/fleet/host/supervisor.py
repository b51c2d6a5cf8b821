"""`python -m lfa.deploy.fleet.host.supervisor PART`: supervisor of one machine's processes.

It depends neither on the machine that ran `lfa up` nor on any other: its engine starts the router, the robots and the
other processes of its plan and restarts those that end or hang. The supervisor publishes their status once a second
(topic `host`) and executes an operator's orders (topic `order`). SIGTERM ends everything in order, also without a
router. The processes outlive a supervisor that dies: its guardian (`guardian.py`) starts it again, and it adopts them.
"""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # noqa: F401 (before any other module)

# isort: split
import os
import select
import signal
import sys
import threading
from collections import OrderedDict
from pathlib import Path

import msgspec

from lfa.deploy.fleet.engine.engine import LogSource, ProcessEngine
from lfa.deploy.fleet.engine.own import OwnEngine
from lfa.deploy.fleet.engine.systemd import SystemdEngine
from lfa.deploy.fleet.host.guardian_watch import GuardianWatch
from lfa.deploy.fleet.host.ledger import Ledger, ledger, living, sweep
from lfa.deploy.fleet.host.units_host import scope_of
from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.fleet.plan.files import LEDGER
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.process import identity
from lfa.deploy.process.restart_policy import REFUSED_CODE
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.fleet import HostOrder, HostStatus, LogLines
from lfa.protocol.outbox import Outbox
from lfa.protocol.output import replace_file, write_line
from lfa.protocol.runtime.systemd import Notify
from lfa.protocol.topics import HOST_PREFIX, OPERATOR_NAME, alive_key, key
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.links import Links
from lfa.protocol.transport.message_bus import Decoder, send
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import LINK_LEASES_MS, RouterAbsent
from lfa.world.description.scenario import STATE

TELL_S = 1.0
STEP_S = 0.1
JOIN_S = 0.1
LAST_WORDS_S = 0.1
LEAVE_S = 0.5
"""Time limit [s] for closing the session, which takes longer if the router hangs."""
OPERATORS_MAX = 64


class Supervisor:
    """Supervisor of one machine. Every call comes from the main thread, which the kernel takes as the parent."""

    def __init__(self, part: HostPlan, engine: ProcessEngine) -> None:
        self._part = part
        self._me = f"{HOST_PREFIX}{part.host}"
        self._engine = engine
        self._outbox = Outbox(part.fleet, self._me, incarnations.drawn(), first=1)
        self._obeyed = (0, 0)
        self._orders: OrderedDict[int, int] = OrderedDict()
        """Last sequence number of each operator, by incarnation."""
        self._book: Ledger | None = None
        """Ledger on disk."""
        self._refused = False
        """True: the disk did not take the last ledger."""
        self._guardian = None if engine.bound else GuardianWatch(part)
        self._sign = Notify(os.environ.get("NOTIFY_SOCKET", ""))
        self._ordered = False
        """True: an operator ordered the end."""
        self._tell_at = 0.0
        self._join_at = 0.0
        self._wake = threading.Event()
        self._inbox = Inbox(self._wake)
        self._links = Links()
        self._decoder = Decoder()
        self._bus: ZenohBus | None = None
        self._tails: dict[str, LogSource] = {}
        self._ending = False

    def run(self) -> bool:
        """Run until SIGTERM, Ctrl-C or an order `down`; return True when all processes have ended.

        Those of another engine go on after a signal.
        """
        bell, ring = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.set_wakeup_fd(ring)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: self._stop())
        signal.signal(signal.SIGCHLD, lambda *_: None)
        self._adopt()
        self._sign.ready()
        wakes = [bell, *(one.fileno() for one in self._engine.wakes)]
        while not self._ending:
            self._step(clock.now())
            if not self._wake.is_set():
                ready, _, _ = select.select(wakes, [], [], STEP_S)
                if bell in ready:
                    os.read(bell, 4096)
            self._wake.clear()
        over = self._ordered or not self._engine.bound
        self._end(over=over)
        return over

    def _stop(self) -> None:
        self._ending = True

    def _adopt(self) -> None:
        """Take over what an earlier supervisor started, and end what it started that is not of this plan."""
        written = ledger(self._part.folder)
        known = () if written is None else written.processes
        self._engine.start(clock.now(), known)
        adopted = [one.identity for one in self._engine.known()]
        for orphan in (one.identity for one in known if one.identity not in adopted):
            if identity.send_signal(orphan, signal.SIGKILL):
                write_line(f"ended an orphan of an earlier supervisor: {' '.join(orphan.arguments)}", sys.stdout)
        self._write_ledger()

    def _step(self, now: float) -> None:
        changed = self._engine.step(now, router_up=self._bus is not None)
        if self._guardian is not None:
            self._guardian.step(now)
        self._join(now)
        ordered = self._hear(now)
        if changed or ordered or now >= self._tell_at:
            self._tell(now)
        for name, tail in list(self._tails.items()):
            lines = tail.take(now)
            if lines:
                self._publish("log", LogLines(self._outbox.header("log", now), name, lines))
            if tail.over(now):
                del self._tails[name]

    def _write_ledger(self) -> None:
        me = identity.identify(os.getpid())
        assert me is not None
        book = Ledger(self._part.run, self._part.digest, me, tuple(self._engine.known()))
        if book == self._book:
            return
        path = self._part.folder / LEDGER
        reason = replace_file(path, msgspec.json.encode(book))
        if reason and not self._refused:
            write_line(f"{path}: {reason}: it is written when the disk takes it", sys.stdout)
        self._refused = bool(reason)
        if not reason:
            self._book = book

    def _end(self, *, over: bool) -> None:
        """Leave the fleet; if it is `over` here, first terminate robots and world, and at last the router."""
        if self._guardian is not None:
            self._guardian.end()
        if over:
            self._engine.stop(clock.now(), router=False)
        self._tell(clock.now())
        if self._bus is not None:
            clock.sleep(LAST_WORDS_S)
            leaving = threading.Thread(target=self._bus.close, daemon=True)
            leaving.start()
            leaving.join(LEAVE_S)
        if over:
            self._engine.stop(clock.now(), router=True)

    # --- messages --------------------------------------------------------------------------------------------------

    def _join(self, now: float) -> None:
        """Open a session as soon as a router answers; from then on Zenoh reconnects by itself."""
        if self._bus is not None or now < self._join_at:
            return
        self._join_at = now + JOIN_S
        try:
            bus = ZenohBus(
                self._part.endpoint, self._inbox, LINK_LEASES_MS[self._part.link], self._part.known_as(self._me)
            )
        except (RouterAbsent, Refused):
            return
        orders = key(self._part.fleet, OPERATOR_NAME, "order")
        bus.follow(frozenset({orders, alive_key(self._part.fleet, "*", "*")}))
        bus.announce(self._part.fleet, self._me, self._outbox.incarnation)
        self._bus = bus

    def _hear(self, now: float) -> bool:
        obeyed = False
        if self._bus is not None and self._links.due(now):
            self._bus.resubscribe()
        arrivals = self._inbox.take()
        for arrival in arrivals:
            if not isinstance(arrival.payload, bytes):
                self._links.see(arrival.payload, now)
        for _, order in self._decoder.messages(arrivals):
            if isinstance(order, HostOrder):
                obeyed = self._obey(order, now) or obeyed
        return obeyed

    def _obey(self, order: HostOrder, now: float) -> bool:
        """Execute each order once, however often it is repeated; return True when it is to be confirmed."""
        place, _, name = order.target.rpartition("/")
        here = not place and name in ("", self._part.host)
        names = self._engine.names if here else (name,)
        if place not in ("", self._part.host) or not (here or name in self._engine.names):
            return False
        number = (order.header.incarnation, order.header.seq)
        if order.header.seq <= self._orders.get(order.header.incarnation, 0):
            return True
        self._orders[order.header.incarnation] = order.header.seq
        if len(self._orders) > OPERATORS_MAX:
            self._orders.popitem(last=False)
        self._obeyed = number
        write_line(f"order: {order.action} {order.target}", sys.stdout)
        if order.action == "down" and here:
            self._ending = self._ordered = True
        elif order.action == "restart":
            for one in names:
                self._engine.restart(one, now)
        elif order.action == "logs":
            for one in names:
                if order.lines or one not in self._tails:
                    self._tails[one] = self._engine.logs(one, order.lines, now)
                self._tails[one].prolong(now)
        return True

    def _tell(self, now: float) -> None:
        self._tell_at = now + TELL_S
        self._sign.alive()
        self._write_ledger()
        part, reports = self._part, self._engine.states(now)
        header = self._outbox.header("host", now)
        self._publish("host", HostStatus(header, part.host, part.version, part.run, self._obeyed, reports))

    def _publish(self, topic: str, message: Message) -> None:
        if self._bus is not None:
            send(self._bus, self._outbox.envelope(topic, message))


def main() -> None:
    """Run the supervisor. Exit codes: 0 ended in order, 2 refused; after any other, its processes go on."""
    try:
        _supervise(host_plan.read(Path(sys.argv[1])))
        code = 0
    except Refused as refused:
        write_line(f"lfa-supervise: {refused}", sys.stderr)
        code = REFUSED_CODE
    sys.stdout.flush()
    os._exit(code)  # a session that did not close would block the exit


def _supervise(part: HostPlan) -> None:
    """Supervise until the end in order. Raises Refused, with nothing left."""
    if living(part.folder) is not None:
        raise Refused(f"fleet {part.fleet} already runs in {part.folder}: lfa down first")
    rows = host_plan.rows(part)
    engine: ProcessEngine
    if part.engine == "own":
        engine = OwnEngine(rows, part.restart, part.folder, part.run_folder, remembered=part.run_folder / STATE)
    else:
        engine = SystemdEngine(part.fleet, part.host, [row.name for row in rows], scope_of(part))
    try:
        over = Supervisor(part, engine).run()
    except Refused:
        engine.kill()
        raise
    engine.close()
    if over:
        sweep(part.folder)


if __name__ == "__main__":
    main()
