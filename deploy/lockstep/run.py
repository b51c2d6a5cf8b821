"""A run in lockstep: `lfa sim` with each agent in a process of its own, which gets its time from granted ticks."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from signal import Signals

from lfa.deploy.client.operator import Operator
from lfa.deploy.faults.script import Fault
from lfa.deploy.lockstep.stepping import STEP, STEPPED, TICKS_MAX, Pace, Stepping
from lfa.deploy.lockstep.team import GrantedTeam
from lfa.deploy.process.process_group import ProcessGroup, ProcessSpec
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.recording.outcome import Verdict
from lfa.deploy.recording.provenance import provenance
from lfa.deploy.recording.recorder import Recorder
from lfa.deploy.recording.run_folder import JOURNALS, About, make
from lfa.deploy.run.finish import Ended, finish, verdict_of
from lfa.deploy.run.launch import socket_folder
from lfa.deploy.run.process_table import granted_row
from lfa.deploy.run.simulate import FLEET, SimulatedRun, refuse_faults
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import BadMessage, decode
from lfa.protocol.messages.team import OperatorNote
from lfa.protocol.names import robot_name
from lfa.protocol.output import write_line
from lfa.protocol.transport.zenoh_grants import GrantHub
from lfa.world.description.load import Scenario, draw

MODE = "lockstep"


def run(scenario: Scenario, seed: int, out: Path | None, faults: Sequence[Fault], pace: Pace) -> Ended:
    """Run `scenario` drawn with `seed`; all processes have ended when this returns. Raises Refused for bad input."""
    drawn = draw(scenario, seed)
    refuse_faults(drawn, faults)
    folder = make(out, drawn)
    about = About(scenario.name, MODE, seed, FLEET, provenance())
    sockets = socket_folder()
    try:
        with Interrupts() as interrupts:
            return _LockstepLaunch(drawn, seed, folder, about, sockets, interrupts).play(faults, pace)
    finally:
        shutil.rmtree(sockets, ignore_errors=True)


class _LockstepLaunch:
    """One lockstep run: its processes, the simulation that grants their time, and its recorder."""

    def __init__(
        self, drawn: Scenario, seed: int, folder: Path, about: About, sockets: Path, interrupts: Interrupts
    ) -> None:
        self._drawn = drawn
        self._seed = seed
        self._folder = folder
        self._about = about
        self._endpoint = f"unixsock-stream/{sockets / 'router.sock'}"
        self._interrupts = interrupts
        self._group = ProcessGroup(folder)
        self._hub = GrantHub(self._endpoint, FLEET)
        self._operator = Operator(FLEET, 1)
        self._asked = 0
        """Incarnation of the operator whose step is carried out."""
        self._team = GrantedTeam(self._hub, self._group, self._spec, lambda: self._signal is not None)

    @property
    def _signal(self) -> Signals | None:
        return self._interrupts.signal

    def play(self, faults: Sequence[Fault], pace: Pace) -> Ended:
        """Execute the run and write its folder."""
        recorder = Recorder(self._folder, self._about.metadata())
        started, left, run = clock.now(), [str(fault) for fault in faults], None
        try:
            run = self._started(faults, recorder)
            started = clock.now()
            self._advance(run, pace)
            verdict, left = run.close(verdict_of(self._interrupts) or self._alone(run)), run.faults_left
            self._team.dismiss(robot_name(robot) for robot in self._drawn.robots)
            self._group.wait([robot_name(robot) for robot in self._drawn.robots], 1.0)
        except _NotStarted as error:
            verdict = verdict_of(self._interrupts) or Verdict("aborted", str(error))
        finally:
            self._hub.close()
            self._group.kill_all()
            recording = recorder.close()
        return finish(self._folder, self._about, verdict, clock.now() - started, left, self._signal, recording)

    def _started(self, faults: Sequence[Fault], recorder: Recorder) -> SimulatedRun:
        """Start all processes and the simulation. Raises _NotStarted."""
        mission = self._drawn.mission
        self._team.start((robot, robot not in mission.robots) for robot in self._drawn.robots)
        try:
            run = SimulatedRun(
                self._drawn,
                self._seed,
                faults,
                recorder.record,
                self._folder / JOURNALS,
                make_agent=self._team.agent,
                make_host=self._team.host,
            )
        except Refused as refused:
            raise _NotStarted(str(refused)) from None
        self._team.upcoming = run.upcoming

        def lose(name: str, why: str) -> None:
            write_line(f"{run.now:.3f} s: {why}", sys.stderr)
            run.lose(name, why)

        self._team.lost = lose
        return run

    def _advance(self, run: SimulatedRun, pace: Pace) -> None:
        """Go on to the verdict or an interrupt, at the given pace; stand where it says so, until `lfa step`."""
        stepping = Stepping(pace, run.tick_s)

        def over() -> bool:
            stepping.hold(run.now, lambda: self._signal is not None)
            return self._signal is not None or self._alone(run) is not None

        while run.verdict is None and not over():
            run.advance(stepping.until, over)
            if run.now >= stepping.until and run.verdict is None and not over():
                self._stand(run, stepping)

    def _stand(self, run: SimulatedRun, stepping: Stepping) -> None:
        """Stand at a tick, and say so, until an operator grants more."""
        self._tell(run, "stands")
        write_line(f"stands at tick {stepping.tick} ({run.now:.3f} s): lfa step 1, or lfa step to go on", sys.stderr)
        while self._signal is None:
            self._hub.receive()  # returns now and then
            for payload in self._hub.orders():
                note = _step(payload)
                if note is not None:
                    self._asked = note.header.incarnation
                    ticks = note.arguments["ticks"]
                    stepping.go_on(ticks or None)
                    if not ticks:
                        self._tell(run, "goes on")
                    return

    def _tell(self, run: SimulatedRun, what: str) -> None:
        """Answer the operator who has asked last."""
        tick = round(run.now / run.tick_s)
        self._hub.publish(self._operator.event(STEPPED, run.now, what=what, tick=tick, asked=self._asked))

    def _alone(self, run: SimulatedRun) -> Verdict | None:
        """Return the verdict of a run in which no agent is left and none comes back."""
        present = any(robot_name(robot) in run.present for robot in self._drawn.robots)
        return None if present or run.faults_left else Verdict("aborted", "no agent is left")

    def _spec(self, robot_id: int, incarnation: int, spare: bool) -> ProcessSpec:
        return granted_row(robot_id, incarnation, self._endpoint, FLEET, self._drawn.mission, spare=spare)


class _NotStarted(Exception):
    """Error: a process was not there when the run was to begin."""


def _step(payload: bytes) -> OperatorNote | None:
    """Return an operator's order to go on, by `ticks` or, with 0, without an end; None for any other message."""
    try:
        note = decode(payload, OperatorNote)
    except BadMessage:
        return None
    if not isinstance(note, OperatorNote) or note.command != STEP:
        return None
    ticks = note.arguments.get("ticks")
    return note if isinstance(ticks, int) and 0 <= ticks <= TICKS_MAX else None
