"""Execution of one fault schedule in virtual time, on leases and gateways or on complete agents, with all checkers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Union

from msgspec import Struct, structs

from lfa.deploy.analysis.causes.broken_rules import RuleWatch
from lfa.deploy.analysis.causes.fact_log import BrokenRule
from lfa.deploy.analysis.verification.checker import Checker, Violation
from lfa.deploy.analysis.verification.fleet_stop import LatchKept
from lfa.deploy.analysis.verification.leadership import NextInChain, Steady, StopsWithoutQuorum
from lfa.deploy.analysis.verification.liveness import AFTER_FAULTS
from lfa.deploy.analysis.verification.safety import SAFETY
from lfa.deploy.analysis.verification.words_kept import WORDS_KEPT
from lfa.deploy.client.stop_call import StopOutcome
from lfa.deploy.fuzz.lease_processes import Process
from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.deploy.fuzz.link_faults import LinkFaults, target_of
from lfa.deploy.fuzz.network import Trace
from lfa.deploy.fuzz.roster_calls import RosterCalls
from lfa.deploy.fuzz.schedules import FIRST_AT_S, LEADER, Schedule, ScheduledFault
from lfa.deploy.fuzz.stops import StopQuestions, StopTraffic
from lfa.deploy.fuzz.tricks import Tricks
from lfa.protocol.lease.membership import team_of
from lfa.protocol.lease.quorum import is_quorum
from lfa.protocol.messages.consensus import LeaseBody, Member
from lfa.protocol.mission import Mission
from lfa.protocol.names import WITNESS_ID
from lfa.world.virtual_time import VirtualTime

if TYPE_CHECKING:
    from lfa.deploy.fuzz.agent_processes import AgentProcess
    from lfa.deploy.fuzz.agent_simulation import AgentSimulation

Simulation = Union["LeaseSimulation", "AgentSimulation"]
"""Simulation that executes a schedule: leases only, or complete agents."""
STEP_S = 0.001
"""Time [s] that a process which lags runs before it waits again: for its tick, too."""
EXIT_S = 0.3
"""Time [s] sufficient for the last messages of a process that was requested to exit."""


class Played(Struct):
    """Result of one schedule."""

    schedule: Schedule
    violations: list[Violation]
    counts: Counter[str]
    """Number of faults that took effect, by kind."""
    elections: int
    simulation: Simulation | VirtualTime
    stops: list[tuple[float, float, StopOutcome]]
    """Results of the operators' calls that have ended, with the times [s] of their begin and end."""
    broken: BrokenRule | None = None
    """Rule that the first violation to show one shows to be broken, with its chain of causes; None: none does."""


class MessageHolder:
    """Filter of a network: counts the messages of leases from the first fault on, and disturbs those of a schedule."""

    def __init__(self, network: VirtualTime, schedule: Schedule) -> None:
        self._network = network
        self._from_s = schedule.faults[0].at if schedule.faults else FIRST_AT_S
        self._held = {held.number: held.by_s for held in schedule.held}
        self._number = -1

    def __call__(self, _src: int, _to: int, _body: LeaseBody) -> float | None:
        """Return how much longer [s] the next message takes; None: it is lost."""
        if self._network.now < self._from_s:
            return 0.0
        self._number += 1
        return self._held.get(self._number, 0.0)


class Faults:
    """Injector of a schedule's faults into a simulation: counts those that took effect, then heals."""

    def __init__(self, simulation: Simulation, schedule: Schedule) -> None:
        self.simulation = simulation
        self.schedule = schedule
        self._links = LinkFaults(simulation, schedule.radio)
        self.counts: Counter[str] = Counter()
        for fault in schedule.faults:
            simulation.at(fault.at, self._do, fault)
        simulation.at(schedule.faults_until_s, self.heal)

    def _do(self, fault: ScheduledFault) -> None:
        target = target_of(self.simulation, fault)
        # The effects of a fault end with all faults at the latest: L1-L4 count from there.
        simulation, until = self.simulation, self.schedule.faults_until_s
        lasts = min(simulation.now + fault.duration_s, until)
        done = True
        match fault.kind:
            case "kill" if target is not None:
                simulation.kill(target, hinted=simulation.random.random() < 0.8)
            case "restart" | "witness" if target is not None:
                simulation.kill(target)
                simulation.at(lasts, self._start, target)
            case "mixed" if target is not None:
                simulation.start(target, mission=self._other_mission(fault))
                simulation.at(lasts, self._start_right, target, simulation.processes[target].member)
            case "exit" if target is not None:
                simulation.exit(target)
                simulation.at(min(lasts + EXIT_S, until), self._start, target)
            case "clock_step" if target is not None:
                self._step_wall(fault, target, lasts)
            case "pause" if target is not None:
                simulation.pause(target)
                simulation.at(lasts, simulation.resume, target, fault.value > 0.0)
            case "hand_over" if target is not None:
                simulation.hand_over(target)
            case "false_hint" if target is not None:
                seers = [i for i in fault.targets[1:] if i != target and i in simulation.ids]
                simulation.hint(target, *seers)
                if fault.value > 0.0:
                    simulation.latch(target, simulation.processes[target].member.incarnation)
                if fault.duration_s > 0.0:
                    simulation.at(lasts, self._hint_back, target, simulation.processes[target].member, tuple(seers))
            case "gateway" if target is not None and target != WITNESS_ID:
                simulation.kill_gateway(target)
                simulation.at(lasts, self._start_gateway, target)
            case _:
                done = self._disturb(fault, target, lasts)
        self.counts[fault.kind] += done
        if done and simulation.trace is not None:
            simulation.trace(simulation.now, WITNESS_ID if target is None else target, f"# {fault.kind}")

    def _disturb(self, fault: ScheduledFault, target: int | None, lasts: float) -> bool:
        """Inject a fault of the network; return True if it took effect."""
        simulation = self.simulation
        match fault.kind:
            case "lag":
                aimed_at = (target if i == LEADER else i for i in fault.targets)
                late = [i for i in aimed_at if i is not None and i in simulation.processes]
                for robot_id in late:
                    self._step_late(robot_id, lasts, fault.value)
                return bool(late)
        return self._links.disturb(fault, target, lasts)

    def _step_late(self, target: int, until: float, lag_s: float) -> None:
        """Let a process do nothing for up to `lag_s` [s], then all that has come meanwhile, again and again."""
        simulation, process = self.simulation, self.simulation.processes[target]
        if simulation.now >= until:
            return
        woken_at = min(simulation.now + simulation.random.uniform(0.0, lag_s), until)
        if process.alive and not process.paused:
            simulation.pause(target)
            simulation.at(woken_at, self._wake, process)
        simulation.at(woken_at + STEP_S, self._step_late, target, until, lag_s)

    def _wake(self, process: Process | AgentProcess) -> None:
        if self.simulation.processes[process.id] is process:
            self.simulation.resume(process.id)

    def _start(self, target: int) -> None:
        if not self.simulation.processes[target].alive:
            self.simulation.start(target)

    def _other_mission(self, fault: ScheduledFault) -> Mission:
        """Return the mission that a mixed-up process holds: of another version, or with another profile."""
        mission = self.simulation.mission
        if fault.value > 0.0:
            return structs.replace(mission, version=mission.version + 1)
        return structs.replace(mission, profile="wifi" if mission.profile != "wifi" else "fast")

    def _start_right(self, target: int, mixed: Member) -> None:
        if self.simulation.processes[target].member == mixed:
            self.simulation.start(target)

    def _step_wall(self, fault: ScheduledFault, target: int, lasts: float) -> None:
        self.simulation.step_wall(target, fault.value)
        if fault.duration_s > 0.0:
            self.simulation.kill(target)
            self.simulation.at(lasts, self._start, target)

    def _start_gateway(self, robot_id: int) -> None:
        if not self.simulation.gateways[robot_id].alive:
            self.simulation.start_gateway(robot_id)

    def _hint_back(self, target: int, member: Member, seers: tuple[int, ...]) -> None:
        if self.simulation.processes[target].member == member and self.simulation.processes[target].alive:
            self.simulation.hint(target, *seers, up=True)

    def heal(self) -> None:
        """End all faults: reconnect everyone and start processes until a quorum runs.

        All processes start if `revive_all` is set, or if no running process remembers a leader.
        """
        simulation = self.simulation
        simulation.heal()
        simulation.lose_late(self._links.calm_all().prompt_s)
        for robot_id in simulation.robots:
            self._start_gateway(robot_id)
        for target in list(simulation.processes):
            if simulation.processes[target].paused:
                simulation.resume(target)
            if simulation.processes[target].leaving:
                simulation.kill(target)
        for target in sorted(simulation.processes):
            if not simulation.processes[target].alive and (self.schedule.revive_all or not self._quorum_lives()):
                simulation.start(target)
        simulation.tell_healed()

    def _quorum_lives(self) -> bool:
        living = [p for p in self.simulation.processes.values() if p.alive]
        configs = [p.lease.config for p in living if p.lease is not None]
        newest = max(configs, key=lambda c: c.version, default=None)
        if newest is None or not is_quorum(newest, {p.member for p in living}):
            return False
        team = team_of(newest.roster, self.simulation.mission.robots)
        return any(p.id in team for p in living)


def play(schedule: Schedule, trace: Trace | None = None) -> Played:
    """Run one schedule on leases and gateways only. The result depends on the schedule alone, not on earlier runs."""
    return _play(schedule, trace, _lease_simulation)


def play_whole(schedule: Schedule, trace: Trace | None = None) -> Played:
    """Run one schedule on complete agents, witness and world."""
    from lfa.deploy.fuzz.agent_simulation import AgentSimulation

    return _play(schedule, trace, AgentSimulation)


def _lease_simulation(schedule: Schedule) -> Simulation:
    return LeaseSimulation(
        schedule.robots,
        seed=schedule.seed,
        profile=schedule.profile,
        witness=schedule.witness,
        rates=schedule.rates,
        radio=schedule.radio,
        gateways_at_world=schedule.gateways_at_world,
        spares=schedule.spares,
    )


def _play(schedule: Schedule, trace: Trace | None, simulate: Callable[[Schedule], Simulation]) -> Played:
    simulation = simulate(schedule)
    simulation.trace = trace
    watch = RuleWatch(simulation.timing)
    checkers = [watch.log, watch, *(checker(simulation.timing) for checker in _checkers(schedule))]
    for checker in checkers:
        checker.told = watch.note
    simulation.listen(checkers)
    faults = Faults(simulation, schedule)
    traffic = StopTraffic(simulation, simulation.robots, schedule.seed)
    if isinstance(simulation, LeaseSimulation):
        simulation.filter = MessageHolder(simulation, schedule) if schedule.held else None
        StopQuestions(simulation, simulation.robots, traffic.links)
    traffic.begin(schedule.stops)
    simulation.listen([*checkers, traffic.observer])
    if isinstance(simulation, LeaseSimulation):
        rosters = RosterCalls(simulation, schedule.faults_until_s)
        rosters.begin(schedule.rosters)
        Tricks(simulation, schedule.faults_until_s).begin(schedule.tricks)
    simulation.start_all()
    simulation.run(schedule.duration_s)
    for checker in checkers:
        checker.over(simulation.now)
    violations = [v for checker in checkers for v in checker.violations]
    elections = sum(1 for _, _, effect in simulation.log if type(effect).__name__ == "BecomeLeader")
    broken = next((rule for _, rule in watch.broken_rules if rule is not None), None)
    return Played(schedule, violations, faults.counts, elections, simulation, traffic.outcomes, broken)


def _checkers(schedule: Schedule) -> list[type[Checker]]:
    """Return the checkers of all invariants that apply to this schedule."""
    kinds = [*SAFETY, *WORDS_KEPT, LatchKept, *AFTER_FAULTS, StopsWithoutQuorum]
    disturbed = schedule.faults or schedule.rosters or schedule.tricks
    if not disturbed and schedule.profile != "fast":  # 20 % loss may cost "fast" its leader (design, 7)
        kinds.append(Steady)
    if schedule.is_single:
        kinds.append(NextInChain)
    return kinds
