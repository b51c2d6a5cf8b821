"""`python -m lfa.deploy.fleet.host.supervisor PART`: supervisor of one machine's processes.

It depends neither on the machine that ran `lfa up` nor on any other: it starts its router, its robots and the other
processes of its plan, restarts those that end (`restart_policy.py`), publishes their status once a second (topic
`host`) and executes an operator's orders (topic `order`). SIGTERM ends everything in order, also without a router.
Its children do not outlive it (`parent_death.py`); at the start it ends orphans of an earlier incarnation.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from collections import OrderedDict
from pathlib import Path

import msgspec

from lfa.deploy.fleet.host.ledger import LEDGER, Ledger, end_orphans, living, sweep
from lfa.deploy.fleet.host.log_tail import Tail
from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.process import identity
from lfa.deploy.process.process_group import ROUTER_NAME, ProcessGroup, ProcessSpec
from lfa.deploy.process.restart_policy import REFUSED_CODE, ROUTER, RestartBackoff
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.fleet import HostOrder, HostStatus, LogLines, ProcessReport
from lfa.protocol.outbox import Outbox
from lfa.protocol.output import replace_file, write_line
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
ROUTER_S = 3.0
LAST_WORDS_S = 0.1
END_S = 1.5
"""Time limit [s] for children to end. Their final messages take at most 0.7 s; the rest allows for a lost router."""
LEAVE_S = 0.5
"""Time limit [s] for a router to end, which closes links to routers that may have ended already."""
OPERATORS_MAX = 64


class _ManagedProcess:
    """One supervised process: its specification, restart backoff and state."""

    def __init__(self, row: ProcessSpec, backoff: RestartBackoff) -> None:
        self.row = row
        self.backoff = backoff
        self.starts = 0
        self.began = 0.0
        self.began_ms = 0
        self.state = "waiting"
        self.start_at: float | None = 0.0
        self.ended = ""
        self.ordered_end = False

    def report(self, pid: int, now: float) -> ProcessReport:
        up_s = round(now - self.began, 1) if pid else 0.0
        return ProcessReport(self.row.name, self.state, pid, self.starts, self.began_ms, up_s, self.ended)


class Supervisor:
    """Supervisor of one machine. Every call comes from the main thread, which the kernel takes as the parent."""

    def __init__(self, part: HostPlan) -> None:
        self._part = part
        self._me = f"{HOST_PREFIX}{part.host}"
        self._processes = ProcessGroup(part.run_folder)
        self._managed = {
            row.name: _ManagedProcess(row, RestartBackoff(ROUTER if row.name == ROUTER_NAME else part.restart))
            for row in host_plan.rows(part)
        }
        self._outbox = Outbox(part.fleet, self._me, incarnations.drawn(), first=1)
        self._obeyed = (0, 0)
        self._orders: OrderedDict[int, int] = OrderedDict()
        """Last sequence number of each operator, by incarnation."""
        self._book: Ledger | None = None
        """Ledger on disk."""
        self._refused = False
        """True: the disk did not take the last ledger."""
        self._began = clock.now()
        self._tell_at = 0.0
        self._join_at = 0.0
        self._wake = threading.Event()
        self._inbox = Inbox(self._wake)
        self._links = Links()
        self._decoder = Decoder()
        self._bus: ZenohBus | None = None
        self._tails: dict[str, Tail] = {}
        self._ending = False

    def run(self) -> int:
        """Run until SIGTERM, Ctrl-C or an order `down`; all children have ended when it returns 0."""
        bell, ring = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.set_wakeup_fd(ring)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: self._stop())
        signal.signal(signal.SIGCHLD, lambda *_: None)
        try:
            self._write_ledger()
            while not self._ending:
                self._step(clock.now())
                if not self._wake.is_set():
                    ready, _, _ = select.select([bell], [], [], STEP_S)
                    if ready:
                        os.read(bell, 4096)
                self._wake.clear()
            self._end()
            return 0
        finally:
            self._processes.kill_all()
            sweep(self._part.folder)

    def _stop(self) -> None:
        self._ending = True

    def _step(self, now: float) -> None:
        changed = [managed for managed in self._managed.values() if self._look_after(managed, now)]
        self._join(now)
        told = self._hear(now)
        if changed or told or now >= self._tell_at:
            self._tell(now)
        for name, tail in list(self._tails.items()):
            lines = tail.take(now)
            if lines:
                self._publish("log", LogLines(self._outbox.header("log", now), name, lines))
            if tail.over(now):
                del self._tails[name]

    # --- the processes ---------------------------------------------------------------------------------------------

    def _look_after(self, managed: _ManagedProcess, now: float) -> bool:
        """Start the process when it is due, detect its end; return True when its state changed."""
        name = managed.row.name
        if managed.start_at is not None:
            if now < managed.start_at or (name != ROUTER_NAME and self._waits_for_router(now)):
                return False
            self._start(managed, now)
            return True
        code = self._processes.code(name)
        if managed.state != "running" or code is None:
            return False
        managed.ended = str(self._processes.exit_of(name))
        write_line(managed.ended, sys.stdout)
        if managed.ordered_end:
            managed.ordered_end = False
            managed.start_at, managed.state = now, "waiting"
            return True
        verdict = managed.backoff.ended(code, now)
        managed.start_at, managed.state = verdict.at, verdict.word
        if name == ROUTER_NAME and verdict.at is None:
            if managed.starts == 1:
                raise Refused(managed.ended)
            managed.start_at, managed.state = now + TELL_S, "waiting"  # it could listen before: retry
        return True

    def _waits_for_router(self, now: float) -> bool:
        """Return True during startup until the router is up, so that processes need not retry to connect."""
        return self._bus is None and now < self._began + ROUTER_S

    def _start(self, managed: _ManagedProcess, now: float) -> None:
        row = managed.row if managed.starts == 0 or not self._remembers(managed) else managed.row.restarted()
        managed.start_at = None
        managed.began, managed.began_ms = now, clock.wall_ms()
        managed.starts += 1
        try:
            self._processes.start(row)
            managed.state = "running"
        except OSError as error:
            managed.ended = f"{row.name} cannot be started: {error.strerror}"
            verdict = managed.backoff.ended(1, now)
            managed.start_at, managed.state = verdict.at, verdict.word

    def _remembers(self, managed: _ManagedProcess) -> bool:
        """Return False for a world that ended before it wrote its first state: it starts without `--resume`."""
        return not managed.row.restart_args or (self._part.run_folder / STATE).exists()

    def _write_ledger(self) -> None:
        me = identity.identify(os.getpid())
        assert me is not None
        children = [self._processes.identity(name) for name in self._managed]
        book = Ledger(self._part.run, self._part.digest, me, tuple(child for child in children if child is not None))
        if book == self._book:
            return
        path = self._part.folder / LEDGER
        reason = replace_file(path, msgspec.json.encode(book))
        if reason and not self._refused:
            write_line(f"{path}: {reason}: it is written when the disk takes it", sys.stdout)
        self._refused = bool(reason)
        if not reason:
            self._book = book

    def _end(self) -> None:
        """Terminate robots and world in order, publish a last status, then terminate the router."""
        self._processes.terminate([name for name in self._managed if name != ROUTER_NAME], END_S)
        for managed in self._managed.values():
            if managed.row.name != ROUTER_NAME:
                managed.state, managed.ended = "ended", "lfa down"
        self._tell(clock.now())
        if self._bus is not None:
            clock.sleep(LAST_WORDS_S)
            leaving = threading.Thread(target=self._bus.close, daemon=True)
            leaving.start()
            leaving.join(LEAVE_S)  # closing takes longer if the router hangs
        self._processes.terminate([ROUTER_NAME], LEAVE_S)

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
        told = False
        if self._bus is not None and self._links.due(now):
            self._bus.resubscribe()
        arrivals = self._inbox.take()
        for arrival in arrivals:
            if not isinstance(arrival.payload, bytes):
                self._links.see(arrival.payload, now)
        for _, order in self._decoder.messages(arrivals):
            if isinstance(order, HostOrder):
                told = self._obey(order, now) or told
        return told

    def _obey(self, order: HostOrder, now: float) -> bool:
        """Execute each order once, however often it is repeated; return True when it is to be confirmed."""
        place, _, name = order.target.rpartition("/")
        here = not place and name in ("", self._part.host)
        if place not in ("", self._part.host) or not (here or name in self._managed):
            return False
        number = (order.header.incarnation, order.header.seq)
        if order.header.seq <= self._orders.get(order.header.incarnation, 0):
            return True
        self._orders[order.header.incarnation] = order.header.seq
        if len(self._orders) > OPERATORS_MAX:
            self._orders.popitem(last=False)
        self._obeyed = number
        write_line(f"order: {order.deed} {order.target}", sys.stdout)
        if order.deed == "down" and here:
            self._ending = True
        elif order.deed == "restart":
            for managed in self._managed.values() if here else (self._managed[name],):
                self._start_again(managed, now)
        elif order.deed == "logs":
            for one in self._managed if here else (name,):
                if order.lines or one not in self._tails:
                    self._tails[one] = Tail(self._processes.log(one), order.lines, now)
                self._tails[one].prolong(now)
        return True

    def _start_again(self, managed: _ManagedProcess, now: float) -> None:
        managed.backoff.forget()
        if self._processes.runs(managed.row.name):
            managed.ordered_end = True
            self._processes.signal(managed.row.name, signal.SIGTERM)
            self._processes.signal(managed.row.name, signal.SIGCONT)
        else:
            managed.start_at = now

    def _tell(self, now: float) -> None:
        self._tell_at = now + TELL_S
        self._write_ledger()
        reports = tuple(managed.report(self._processes.pid(name), now) for name, managed in self._managed.items())
        part = self._part
        header = self._outbox.header("host", now)
        self._publish("host", HostStatus(header, part.host, part.version, part.run, self._obeyed, reports))

    def _publish(self, topic: str, message: Message) -> None:
        if self._bus is not None:
            send(self._bus, self._outbox.envelope(topic, message))


def main() -> None:
    """Run the supervisor. Exit codes: 0 ended in order, 2 refused."""
    try:
        part = host_plan.read(Path(sys.argv[1]))
        if living(part.folder) is not None:
            raise Refused(f"fleet {part.fleet} already runs in {part.folder}: lfa down first")
        for orphan in end_orphans(part.folder):
            write_line(f"ended an orphan of an earlier supervisor: {orphan}", sys.stdout)
        code = Supervisor(part).run()
    except Refused as refused:
        write_line(f"lfa-supervise: {refused}", sys.stderr)
        code = REFUSED_CODE
    os._exit(code)  # a session that did not close would block the exit


if __name__ == "__main__":
    main()
