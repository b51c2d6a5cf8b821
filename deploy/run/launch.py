"""`lfa run`: a scenario with router, recorder, world and agents as processes of this machine.

The launcher starts them, observes the bus, injects the faults, and ends them all. If the launcher itself is killed,
the kernel ends router, world and agents (`parent_death.py`), and the recorder closes the run folder.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from lfa.deploy.client.fleet_state import FleetState
from lfa.deploy.client.operator import Operator
from lfa.deploy.faults.feasible import check_faults
from lfa.deploy.faults.script import Fault
from lfa.deploy.process.process_group import ROUTER_NAME, ProcessGroup
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.recording.outcome import Verdict
from lfa.deploy.recording.provenance import provenance
from lfa.deploy.recording.run_folder import About, make
from lfa.deploy.recording.simulation_time import WorldTime
from lfa.deploy.run.fault_execution import FaultExecution
from lfa.deploy.run.finish import Ended, finish, reread, verdict_of
from lfa.deploy.run.process_table import rows
from lfa.deploy.run.progress import Progress, progress
from lfa.deploy.run.progress_rows import ProgressRows
from lfa.deploy.run.recorder_process import RecorderTask, RunResult
from lfa.deploy.run.restarted_processes import RestartedProcesses
from lfa.deploy.run.termination import Termination
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.names import robot_name
from lfa.protocol.node import Envelope
from lfa.protocol.topics import RECORDER_NAME, WORLD_NAME, alive_key, key
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.links import Links
from lfa.protocol.transport.message_bus import Decoder, send
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import answers
from lfa.world.description.load import Scenario, draw

STEP_S = 0.01
SHOW_EVERY_S = 0.2
START_S_MAX = 20.0
SILENCE_S_MAX = 5.0
SOCKET_FOLDER_MAX = 60
RECORDER_S_MAX = 30.0  # to read the recording and write the summary


def run(scenario: Scenario, seed: int, out: Path | None, faults: Sequence[Fault]) -> Ended:
    """Run `scenario` as processes; all have ended when this returns. Raises Refused for a bad `out` or fault."""
    if scenario.radio.range_m > 0.0:
        raise Refused("radio.range_m: only in lfa sim, say the fault 'range 5 at 0 s' where robots are processes")
    drawn = draw(scenario, seed)
    check_faults(drawn, faults)
    folder = make(out, drawn)
    about = About(scenario.name, "processes", seed, f"{scenario.name}-{os.getpid()}", provenance())
    sockets = socket_folder()
    try:
        with Interrupts() as interrupts:
            launch = _Launch(drawn, folder, about, sockets, faults)
            word = launch.play(interrupts)
            if not launch.summed_up:
                return finish(folder, about, word.verdict, word.duration_s, word.faults_left, interrupts.signal)
            return reread(folder, interrupts.signal)
    finally:
        shutil.rmtree(sockets, ignore_errors=True)


def socket_folder() -> Path:
    """Create a private folder with a short name: a socket's path is limited to 107 bytes."""
    usual = tempfile.gettempdir()
    return Path(tempfile.mkdtemp(prefix="lfa-", dir=usual if len(usual) <= SOCKET_FOLDER_MAX else "/tmp"))


class _Aborted(Exception):
    """Error: a process that the run requires has failed."""


class _Launch:
    """One run: its processes, the observed state, and the faults that are still due."""

    def __init__(self, drawn: Scenario, folder: Path, about: About, sockets: Path, faults: Sequence[Fault]) -> None:
        self._robots = drawn.robots
        self._about = about
        self._endpoint = f"unixsock-stream/{sockets / 'router.sock'}"
        task = msgspec.json.encode(RecorderTask(str(folder), about, self._endpoint, str(sockets))).decode()
        self._rows = rows(folder, about, self._endpoint, drawn, task)
        self._group = ProcessGroup(folder)
        self._termination = Termination(drawn)
        self._state = FleetState()
        self._progress = ProgressRows(drawn.robots, self._state)
        self._time = WorldTime()
        self._heard_at = clock.now()
        self._began_at: float | None = None
        self._operator = Operator(about.fleet, incarnations.drawn())
        self._inbox = Inbox()
        self._decoder = Decoder()
        self._links = Links()
        self._bus: ZenohBus | None = None
        self._processes = RestartedProcesses(self._group, self._rows, drawn.restart, self._publish_event)
        self._faults = FaultExecution(
            drawn.mission,
            drawn.world.walls_m,
            faults,
            self._processes,
            self._time,
            self._operator,
            self._publish,
        )
        self.summed_up = False
        """True once the recorder has written `summary.json`."""

    # --- from start to verdict ----------------------------------------------------------------------------------

    def play(self, interrupts: Interrupts) -> RunResult:
        """Execute the whole run; all processes have ended when this returns or raises."""
        view = progress()
        try:
            verdict = self._watch(interrupts, view)
            now = clock.now()
            left = self._faults.left
            word = RunResult(verdict, now - (self._began_at or now), left)
            self._end(word)
            return word
        finally:
            view.close()
            if self._bus is not None:
                self._bus.close()
            self._group.kill_all()

    def _watch(self, interrupts: Interrupts, view: Progress) -> Verdict:
        try:
            self._start(interrupts)
            show_at = clock.now()
            while verdict_of(interrupts) is None and self._termination.verdict is None:
                self._listen()
                self._check(view)
                self._faults.do_due(self._termination.leader, lambda text: view.note(self._progress, text))
                if clock.now() >= show_at:
                    show_at += SHOW_EVERY_S
                    view.show(self._progress, self._termination.leader)
                clock.sleep(STEP_S)
        except _Aborted as aborted:
            return verdict_of(interrupts) or Verdict("aborted", str(aborted))
        return verdict_of(interrupts) or self._termination.verdict or Verdict("aborted")

    def _start(self, interrupts: Interrupts) -> None:
        """Start the router, then the recorder, so that it misses no message; then world and agents in any order."""
        router, recorder, *others = self._rows
        self._group.start(router)
        self._await(router.name, lambda: answers(self._endpoint), interrupts)
        self._group.start(recorder)
        self._bus = bus = ZenohBus(self._endpoint, self._inbox)
        topics = ("event", "tracking", "table", "status", "truth", "operator", "team_order")
        fleet = self._about.fleet
        followed = frozenset(key(fleet, "*", topic) for topic in topics)
        bus.follow(followed)
        self._await(recorder.name, lambda: bool(bus.living(fleet, RECORDER_NAME)), interrupts)
        bus.follow(followed | {alive_key(fleet, "*", "*")})  # only now: queries for tokens beside it may return nothing
        self._publish_event("start", scenario=self._about.scenario, seed=self._about.seed)
        for row in others:
            self._group.start(row)
        self._heard_at = clock.now()

    def _await(self, name: str, ready: Callable[[], bool], interrupts: Interrupts) -> None:
        until = clock.now() + START_S_MAX
        while not ready():
            self._needs(name)
            if verdict_of(interrupts) is not None:
                raise _Aborted("interrupted")
            if clock.now() > until:
                raise _Aborted(f"{name} was not ready within {START_S_MAX:g} s")
            clock.sleep(STEP_S)

    # --- received messages ------------------------------------------------------------------------------------------

    def _listen(self) -> None:
        now, arrivals = clock.now(), self._inbox.take()
        for arrival in arrivals:
            if not isinstance(arrival.payload, bytes):
                self._links.see(arrival.payload, now)
        if self._links.due(now) and self._bus is not None:
            self._bus.resubscribe()
        for arrival, message in self._decoder.messages(arrivals):
            self._hear(arrival.at, message)

    def _hear(self, at: float, message: Message) -> None:
        if isinstance(message, Truth):
            self._heard_at = at
            self._began_at = at if self._began_at is None else self._began_at
            self._time.see(at, message.time_s)
            self._processes.report_restarts(message.time_s)
        self._faults.hear(message)
        self._termination.see(message)
        self._state.update(at, message)

    # --- supervision -----------------------------------------------------------------------------------------------

    def _check(self, view: Progress) -> None:
        """Check all processes: abort the run if router, recorder or world has ended, and report ended agents."""
        for name in (ROUTER_NAME, RECORDER_NAME, WORLD_NAME):
            if not self._revives(name, view):
                self._needs(name)
        for robot_id in self._robots:
            name = robot_name(robot_id)
            if self._revives(name, view):
                continue
            if self._group.runs(name):
                self._progress.gone.discard(robot_id)
            elif robot_id not in self._progress.gone:
                self._progress.gone.add(robot_id)
                how = self._group.exit_of(name)
                view.note(self._progress, str(how))
                if name not in self._faults.doomed:
                    self._publish_event("died", robot=robot_id, how=how)
        if len(self._progress.gone) == len(self._robots) and not self._faults.pending:
            raise _Aborted("no agent is left")
        # While the last of many robots start, a busy machine keeps the world waiting for seconds.
        starts = not self._time.known or self._processes.restarting or not self._all_heard()
        if clock.now() > self._heard_at + (START_S_MAX if starts else SILENCE_S_MAX):
            raise _Aborted("nothing is heard of the world")

    def _all_heard(self) -> bool:
        return all(robot_name(robot) in self._state.status for robot in self._robots)

    def _revives(self, name: str, view: Progress) -> bool:
        """Return True while a failed process is restarted by the scenario's policy."""
        how = self._group.exit_of(name)
        if not self._processes.revives(name, clock.now()):
            return False
        if self._group.runs(name):
            view.note(self._progress, f"{how}: started again")
            self._faults.repeat_links()
        return True

    def _needs(self, name: str) -> None:
        how = self._group.exit_of(name)
        if how is not None:
            raise _Aborted(how)

    def _publish_event(self, kind: str, **data: object) -> None:
        self._publish(self._operator.event(kind, clock.now(), **data))

    def _publish(self, envelope: Envelope) -> None:
        if self._bus is not None:
            send(self._bus, envelope)

    # --- the end ---------------------------------------------------------------------------------------------------

    def _end(self, word: RunResult) -> None:
        """End agents and world, then the recorder, which writes the summary, then the router, each with a timeout."""
        team = [row.name for row in self._rows if row.name not in (ROUTER_NAME, RECORDER_NAME)]
        # Stamped when published: on a busy machine some agents have ended before the recorder receives it.
        self._publish_event("over", t=self._time.of(clock.now()))
        self._group.terminate(team)
        if self._group.runs(RECORDER_NAME):
            self._group.write_line(RECORDER_NAME, msgspec.json.encode(word))
            self._group.wait([RECORDER_NAME], RECORDER_S_MAX)
            self.summed_up = self._group.succeeded(RECORDER_NAME)
        self._group.terminate([RECORDER_NAME, ROUTER_NAME])
