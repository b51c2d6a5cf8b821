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
from contextlib import suppress
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.fleet.host.log_tail import Tail
from lfa.deploy.fleet.plan import host_plan as parts
from lfa.deploy.fleet.plan.host_plan import HostPlan
from lfa.deploy.process import identity
from lfa.deploy.process.identity import Identity
from lfa.deploy.process.process_group import ROUTER_NAME, ProcessGroup, ProcessSpec
from lfa.deploy.process.restart_policy import REFUSED_CODE, ROUTER, RestartBackoff
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_json
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.fleet import HostOrder, HostStatus, LogLines, ProcessReport
from lfa.protocol.outbox import Outbox
from lfa.protocol.output import replace_file, write_line
from lfa.protocol.topics import HOST_PREFIX, OPERATOR_NAME, alive_key, key
from lfa.protocol.transport.bus import Inbox, Links
from lfa.protocol.transport.message_bus import Decoder, send
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import LINK_LEASES_MS, RouterAbsent
from lfa.world.description.scenario import STATE

LEDGER = "processes.json"
"""File beside the plan with the supervisor and its children; read by a later incarnation, `lfa down`, `lfa doctor`."""
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


class Ledger(Struct, frozen=True):
    """Identities of a fleet's supervisor and child processes on this machine."""

    run: str
    digest: str
    supervisor: Identity
    children: tuple[Identity, ...] = ()


def ledger(folder: Path) -> Ledger | None:
    """Return what the supervisor of that folder wrote last, None without a readable file."""
    try:
        return read_json(folder / LEDGER, Ledger)
    except (OSError, DamagedFile):
        return None


def living(folder: Path) -> Ledger | None:
    """Return the ledger of that folder if its supervisor is running, else None."""
    written = ledger(folder)
    alive = written is not None and identity.identify(written.supervisor.pid) == written.supervisor
    return written if alive else None


def end_orphans(folder: Path) -> list[str]:
    """Kill exactly the processes that the last supervisor of that folder left; return their command lines."""
    written = ledger(folder)
    if written is None or living(folder) is not None:
        return []
    return [" ".join(child.arguments) for child in written.children if identity.send(child, signal.SIGKILL)]


def sweep(folder: Path) -> None:
    """Remove the files that a supervisor could not remove itself: socket, its lock, ledger."""
    for name in (parts.SOCKET, f"{parts.SOCKET}.lock", LEDGER):
        with suppress(OSError):  # of a file system that became read-only: a later start replaces them
            (folder / name).unlink(missing_ok=True)


class _ManagedProcess:
    """One supervised process: its specification, restart backoff and state."""

    def __init__(self, row: ProcessSpec, lives: RestartBackoff) -> None:
        self.row = row
        self.lives = lives
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
            for row in parts.rows(part)
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
        changed = [ward for ward in self._managed.values() if self._look_after(ward, now)]
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

    def _look_after(self, ward: _ManagedProcess, now: float) -> bool:
        """Start the process when it is due, detect its end; return True when its state changed."""
        name = ward.row.name
        if ward.start_at is not None:
            if now < ward.start_at or (name != ROUTER_NAME and self._waits_for_router(now)):
                return False
            self._start(ward, now)
            return True
        code = self._processes.code(name)
        if ward.state != "running" or code is None:
            return False
        ward.ended = str(self._processes.exit_of(name))
        write_line(ward.ended, sys.stdout)
        if ward.ordered_end:
            ward.ordered_end = False
            ward.start_at, ward.state = now, "waiting"
            return True
        verdict = ward.lives.ended(code, now)
        ward.start_at, ward.state = verdict.at, verdict.word
        if name == ROUTER_NAME and verdict.at is None:
            if ward.starts == 1:
                raise Refused(ward.ended)
            ward.start_at, ward.state = now + TELL_S, "waiting"  # it could listen before: retry
        return True

    def _waits_for_router(self, now: float) -> bool:
        """Return True during startup until the router is up, so that processes need not retry to connect."""
        return self._bus is None and now < self._began + ROUTER_S

    def _start(self, ward: _ManagedProcess, now: float) -> None:
        row = ward.row if ward.starts == 0 or not self._remembers(ward) else ward.row.restarted()
        ward.start_at = None
        ward.began, ward.began_ms = now, clock.wall_ms()
        ward.starts += 1
        try:
            self._processes.start(row)
            ward.state = "running"
        except OSError as error:
            ward.ended = f"{row.name} cannot be started: {error.strerror}"
            verdict = ward.lives.ended(1, now)
            ward.start_at, ward.state = verdict.at, verdict.word

    def _remembers(self, ward: _ManagedProcess) -> bool:
        """Return False for a world that ended before it wrote its first state: it starts without `--resume`."""
        return not ward.row.restart_args or (self._part.run_folder / STATE).exists()

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
        for ward in self._managed.values():
            if ward.row.name != ROUTER_NAME:
                ward.state, ward.ended = "ended", "lfa down"
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
            for ward in self._managed.values() if here else (self._managed[name],):
                self._start_again(ward, now)
        elif order.deed == "logs":
            for one in self._managed if here else (name,):
                if order.lines or one not in self._tails:
                    self._tails[one] = Tail(self._processes.log(one), order.lines, now)
                self._tails[one].prolong(now)
        return True

    def _start_again(self, ward: _ManagedProcess, now: float) -> None:
        ward.lives.forget()
        if self._processes.runs(ward.row.name):
            ward.ordered_end = True
            self._processes.signal(ward.row.name, signal.SIGTERM)
            self._processes.signal(ward.row.name, signal.SIGCONT)
        else:
            ward.start_at = now

    def _tell(self, now: float) -> None:
        self._tell_at = now + TELL_S
        self._write_ledger()
        reports = tuple(ward.report(self._processes.pid(name), now) for name, ward in self._managed.items())
        part = self._part
        header = self._outbox.header("host", now)
        self._publish("host", HostStatus(header, part.host, part.version, part.run, self._obeyed, reports))

    def _publish(self, topic: str, message: Message) -> None:
        if self._bus is not None:
            send(self._bus, self._outbox.envelope(topic, message))


def main() -> None:
    """Run the supervisor. Exit codes: 0 ended in order, 2 refused."""
    try:
        part = parts.read(Path(sys.argv[1]))
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
