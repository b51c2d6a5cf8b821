"""`lfa sim`: a scenario in one process and virtual time, with the agents, world, codec and journals of `lfa run`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from math import inf
from pathlib import Path
from typing import NamedTuple

from lfa.agents.agent import Agent
from lfa.deploy.analysis.summarize import summary_of
from lfa.deploy.analysis.summary import Summary
from lfa.deploy.client.mission_changes import along
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.order_calls import OrderCalls
from lfa.deploy.faults.feasible import check_faults
from lfa.deploy.faults.link_faults import goal_of, note
from lfa.deploy.faults.script import COMMON, GOAL, ORDERS, Fault, FaultAction, FaultSchedule
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.recording.mcap_reader import RecordedRun
from lfa.deploy.recording.outcome import Verdict
from lfa.deploy.recording.provenance import provenance
from lfa.deploy.recording.recorder import Recorder
from lfa.deploy.recording.run_folder import JOURNALS, About, make
from lfa.deploy.recording.run_memory import RunMemory
from lfa.deploy.run.finish import Ended, finish, verdict_of
from lfa.deploy.run.termination import JUDGED, Termination
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.grants import GrantedCall
from lfa.protocol.messages.orders import OrderNote
from lfa.protocol.messages.team import Event, OperatorNote
from lfa.protocol.names import robot_id_of, robot_name
from lfa.protocol.node import Node, NodeObserver
from lfa.protocol.output import write_line
from lfa.protocol.plug_in import OWN_FILES
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.runtime.node_host import NodeHost
from lfa.protocol.runtime.state_hashes import HashedJournal, StateHashes
from lfa.protocol.topics import WORLD_NAME
from lfa.protocol.transport.link_model import LINK_CONDITIONS, Radio
from lfa.protocol.transport.message_bus import send
from lfa.protocol.witness import Witness
from lfa.world.collection import seldom_collected
from lfa.world.description.load import Point, Scenario, draw
from lfa.world.simulator import Simulator
from lfa.world.world import World

FLEET = "sim"
MODE = "simulated"
JOURNAL_FLUSH_S = 1.0
SILENCE_S_MAX = 1.0
SHOW_EVERY_S = 5.0  # of wall-clock time
LOOK_EVERY_S = 0.1  # of virtual time, between two looks at what may end a run from outside
LEADER_WAIT_S = 0.01  # polling period of a fault that waits for a leader
ORDER_STEP_S = 0.02  # period in which an operator looks whether the team knows an order
_ANSWERS = (OrderNote, Event)
"""Types of the messages by which a team answers an order."""
MakeHost = Callable[[Node, Journal, Sequence[NodeObserver]], NodeHost]


def run(
    scenario: Scenario, seed: int, out: Path | None, faults: Sequence[Fault] = (), drivers: Sequence[Node] = ()
) -> Ended:
    """Run `scenario` drawn with `seed` and write the run folder. Raises Refused for a bad `out` or fault.

    `drivers` are the hardware of the scenario's real robots; nothing of them is journalled.
    """
    drawn = draw(scenario, seed)
    refuse_faults(drawn, faults)
    folder = make(out, drawn)
    about = About(scenario.name, MODE, seed, FLEET, provenance())
    recorder = Recorder(folder, about.metadata())
    run = SimulatedRun(drawn, seed, faults, recorder.record, folder / JOURNALS, drivers)
    started = time.perf_counter()
    with Interrupts(OWN_FILES) as interrupts, seldom_collected():
        run.advance(inf, lambda: interrupts.signal is not None)
        verdict = run.close(verdict_of(interrupts))
    recording = recorder.close()
    duration_s = time.perf_counter() - started
    return finish(folder, about, verdict, duration_s, run.faults_left, interrupts.signal, recording)


def measure(scenario: Scenario, seed: int, faults: Sequence[Fault] = ()) -> UnrecordedRun:
    """Run `scenario` drawn with `seed` as `run` does, and write nothing.

    The summary is the one that `run` would write, but for durations of this machine's clock, which are 0. Raises
    Refused for a bad fault, and KeyboardInterrupt on a signal.
    """
    drawn, memory = draw(scenario, seed), RunMemory()
    refuse_faults(drawn, faults)
    about = About(scenario.name, MODE, seed, FLEET)
    run = SimulatedRun(drawn, seed, faults, memory.record, None)
    with Interrupts(OWN_FILES) as interrupts, seldom_collected():
        run.advance(inf, lambda: interrupts.signal is not None)
        verdict = run.close(verdict_of(interrupts))
    if interrupts.signal is not None:
        raise KeyboardInterrupt
    seen = memory.seen()
    return UnrecordedRun(summary_of(drawn, seen, memory.events(), about, verdict, 0.0, run.faults_left), seen)


def refuse_faults(drawn: Scenario, faults: Sequence[Fault]) -> None:
    """Raise Refused for a fault of a process that a simulation lacks, and for one that the scenario cannot have."""
    common = next((fault for fault in faults if fault.target in COMMON), None)
    if common is not None:
        raise Refused(f"fault '{common}': only in lfa run, here {common.target} is no process")
    check_faults(drawn, faults)


class UnrecordedRun(NamedTuple):
    """Run that left no files: its summary, and the arrays that it was computed from."""

    summary: Summary
    seen: RecordedRun


class SimulatedRun:
    """Team of a drawn scenario in the simulator, advanced step by step; `record` gets all messages with their times.

    The same faults at the same times give the same messages, whether they are given at the start or added on the way,
    and however the time in between is cut into calls of `advance`.
    """

    def __init__(
        self,
        drawn: Scenario,
        seed: int,
        faults: Sequence[Fault],
        record: Callable[[float, str, Message], None],
        journals: Path | None,
        drivers: Sequence[Node] = (),
        make_agent: Callable[..., Node] = Agent,
        make_host: MakeHost = NodeHost,
    ) -> None:
        """Start the team. `journals` is the folder of the journals, beside which the state hashes are written; None:
        there are none, and the run says nothing about its progress. `make_agent` makes each agent, from the arguments
        of `Agent`, and `make_host` what calls a node.
        """
        self._make_agent = make_agent
        self._scenario = drawn
        self._journals: list[Journal] = []
        self._newest: dict[str, Journal] = {}
        """Journal of the newest incarnation of each process."""
        self._journal_folder = journals
        self._record = record
        self._heard: list[tuple[float, str, Message]] = []
        """Messages that are not recorded yet, with their times [s]."""
        self._termination = Termination(drawn)
        self._schedule = FaultSchedule(faults)
        self._check_at = 0.0
        """Time [s] of the next look at the schedule: the same however the calls of `advance` fall."""
        self._operator = Operator(FLEET, 1)
        self._orders = OrderCalls(self._operator, lambda said: send(self._simulator, said), drawn.mission)
        self._incarnations: dict[str, int] = {}
        self._simulator = Simulator(drawn.radio, seed)
        self._simulator.taps.append(self._hear)
        self._simulator.reborn = self._journal
        self._simulator.make_host = make_host
        self._show_at = inf if journals is None else time.perf_counter() + SHOW_EVERY_S
        self._say("start", scenario=drawn.name, seed=seed)
        self._add(World(FLEET, drawn, seed, self._next_incarnation(WORLD_NAME), start_at=0.0))
        if drawn.mission.witness:
            self._add(Witness(FLEET, 1, 1))
        for driver in drivers:
            heading = Heading(JOURNAL_VERSION, driver.name, driver.incarnation, driver.incarnation, {})
            self._simulator.add(driver, Journal(None, heading))
        for robot_id in drawn.robots:
            self._add(self._agent(robot_id))
        self._hashes = None if journals is None else StateHashes(journals.parent, self._simulator.names)
        self.tick_s = 1.0 / drawn.mission.control_hz
        """Control period [s]: the time between two rows of state hashes."""
        self._flush()
        self._hash(0)
        self._record_heard()

    @property
    def now(self) -> float:
        """Virtual time [s] since the start."""
        return self._simulator.now

    @property
    def leader(self) -> int | None:
        return self._termination.leader

    @property
    def present(self) -> frozenset[str]:
        """Names of the processes that run."""
        return frozenset(self._simulator.names)

    @property
    def radio(self) -> Radio:
        """Present link conditions."""
        return self._simulator.link_model.radio

    @property
    def verdict(self) -> Verdict | None:
        """Outcome, once the run is over."""
        if self._termination.verdict is None and self.now >= self._scenario.time_limit_s + SILENCE_S_MAX:
            return Verdict("aborted", "the world fell silent")
        return self._termination.verdict

    @property
    def faults_left(self) -> list[str]:
        return [str(fault) for fault in self._schedule.pending]

    def add_fault(self, fault: Fault) -> None:
        """Schedule a fault later than `now`."""
        self._schedule.add(fault)
        if self._schedule.pending[0] is fault:
            self._check_at = fault.at_s

    def upcoming(self) -> Iterator[tuple[NodeHost, GrantedCall]]:
        """Yield the next calls of all nodes that are certain (`Simulator.upcoming`)."""
        return self._simulator.upcoming()

    def lose(self, name: str, how: str) -> None:
        """Count the process of a robot as killed now, because of `how` it has ended."""
        self._say("died", robot=robot_id_of(name), how=how, t=self.now)
        self._simulator.kill(name)

    def advance(self, until: float, over: Callable[[], bool] = lambda: False) -> None:
        """Go on to virtual time `until` [s], to the verdict, or until `over()`, which is asked every `LOOK_EVERY_S`."""
        simulator = self._simulator
        until = min(until, self._scenario.time_limit_s + SILENCE_S_MAX)
        while self.verdict is None and simulator.now < until and not over():
            self._show()
            if simulator.now >= self._check_at:
                self._do_due()
            try:
                simulator.run(min(until, self._check_at, simulator.now + LOOK_EVERY_S))
            finally:
                self._record_heard()

    def close(self, instead: Verdict | None = None) -> Verdict:
        """End the run with its verdict, or `instead`; close the journals."""
        verdict = instead or self.verdict or Verdict("interrupted")
        self._say("end", outcome=verdict.outcome, reason=verdict.reason)
        self._record_heard()
        for journal in self._journals:
            journal.close()
        if self._hashes is not None:
            self._hashes.close()
        return verdict

    def _do_due(self) -> None:
        now = self._simulator.now
        for action, victim in self._schedule.due(now, self._termination.leader):
            self._do(action, victim)
        next_s = self._schedule.pending[0].at_s if self._schedule.pending else inf
        self._check_at = next_s if next_s > now else now + LEADER_WAIT_S

    def _show(self) -> None:
        """Show the progress from time to time."""
        if time.perf_counter() >= self._show_at:
            self._show_at = time.perf_counter() + SHOW_EVERY_S
            leader = "no leader" if self._termination.leader is None else f"leader {self._termination.leader}"
            limit_s = self._scenario.time_limit_s
            write_line(f"{self._simulator.now:7.1f} s of at most {limit_s:g} s simulated, {leader}", sys.stderr)

    def _do(self, action: FaultAction, victim: int | str) -> None:
        """Execute a fault action; it has no effect on an absent robot, nor has a restart on a running one."""
        if action in ORDERS:
            self._order(action, victim)
            return
        assert isinstance(victim, int), victim
        name = robot_name(victim)
        present = name in self._simulator.names
        if present == (action == "restart"):
            return
        self._say("fault", deed=action, robot=victim, t=self._simulator.now)
        match action:
            case "kill":
                self._simulator.kill(name)
            case "stop":
                self._simulator.pause(name)
            case "continue":
                self._simulator.resume(name)
            case "terminate":
                self._simulator.terminate(name)
            case "restart":
                self._add(self._agent(victim))

    def _order(self, action: FaultAction, target: int | str) -> None:
        """Execute an operator command: link conditions go to the link model, other commands to all agents."""
        now = self._simulator.now
        self._say("fault", deed=action, robot=target, t=now)
        if action == GOAL:
            self._begin_order(goal_of(str(target)))
            return
        said = note(self._operator, now, action, target, self._scenario.mission.robots)
        if isinstance(said.message, OperatorNote) and said.message.command == LINK_CONDITIONS:
            self._simulator.link_model.obey(said.message.arguments)
            self._heard.append((now, said.key, said.message))
        else:
            send(self._simulator, said)

    def _begin_order(self, goal: Point) -> None:
        """Send the team to another goal [m], as an operator does by `lfa go`."""
        change = along((goal,), self._scenario.world.walls_m)
        self._orders.begin(change, False, self._simulator.now, self._answered)
        self._go_on_ordering()

    def _go_on_ordering(self) -> None:
        self._orders.step(self._simulator.now)
        if self._orders.running:
            self._simulator.at(self._simulator.now + ORDER_STEP_S, self._go_on_ordering)

    def _answered(self, done: bool, text: str) -> None:
        if not done:
            self._say("order_refused", reason=text)

    def _hear(self, now: float, key: str, _payload: bytes, message: Message) -> None:
        self._heard.append((now, key, message))
        if type(message) in JUDGED and self._termination.see(message) is not None:
            self._simulator.halt()
        if isinstance(message, _ANSWERS):
            self._orders.hear(message)

    def _say(self, kind: str, **data: object) -> None:
        now = self._simulator.now
        event = self._operator.event(kind, now, **data)
        self._heard.append((now, event.key, event.message))

    def _record_heard(self) -> None:
        """Record what was heard, many messages one after the other: that takes a third less than each on its way."""
        record = self._record
        for now, key, message in self._heard:
            record(now, key, message)
        self._heard.clear()

    def _add(self, node: Node) -> None:
        self._simulator.add(node, self._journal(node))

    def _journal(self, node: Node) -> Journal:
        started_with = {"fleet": FLEET, **node.started_with}
        heading = Heading(JOURNAL_VERSION, node.name, node.incarnation, node.incarnation, started_with)
        journal = (
            Journal(None, heading) if self._journal_folder is None else HashedJournal(self._journal_folder, heading)
        )
        self._journals.append(journal)
        self._newest[node.name] = journal
        return journal

    def _agent(self, robot_id: int) -> Node:
        incarnation = self._next_incarnation(robot_name(robot_id))
        spare = robot_id not in self._scenario.mission.robots
        return self._make_agent(robot_id, incarnation, FLEET, incarnation, spare=spare)

    def _next_incarnation(self, name: str) -> int:
        self._incarnations[name] = self._incarnations.get(name, 0) + 1
        return self._incarnations[name]

    def _flush(self) -> None:
        """Flush the journals now and every `JOURNAL_FLUSH_S`, to limit their use of memory."""
        for journal in self._journals:
            journal.flush()
        self._simulator.at(self._simulator.now + JOURNAL_FLUSH_S, self._flush)

    def _hash(self, tick: int) -> None:
        """Write the state hashes now, at the tick of this number, and plan the next."""
        if self._hashes is None:
            return
        newest = self._newest
        running = {name: newest[name] for name in self._simulator.names if name in newest}
        self._hashes.write(tick, self.now, running)
        self._simulator.at((tick + 1) * self.tick_s, self._hash, tick + 1)
