"""One schedule of faults carried out on lease and gateway cores in virtual time, with every invariant watched."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Union

from msgspec import Struct, structs

from deploy.look.checkers import SAFETY, Checker, Violation
from deploy.run.arena import Arena, Trace
from deploy.run.schedules import DURATION_S, FAULTS_UNTIL_S, LEADER, Fault, Schedule
from protocol.messages import Member
from protocol.mission import WITNESS_ID
from protocol.quorum import is_quorum

if TYPE_CHECKING:
    from deploy.run.whole import Whole

Stage = Union["Arena", "Whole"]
"""Where a schedule is played: leases alone, or whole agents."""


class Played(Struct):
    """What one schedule came to."""

    schedule: Schedule
    violations: list[Violation]
    counts: Counter[str]
    """Faults that took effect, by kind."""
    elections: int
    arena: Stage


class Faults:
    """Carries out a schedule's faults on an arena, counts those that took effect, and heals."""

    def __init__(self, arena: Stage, schedule: Schedule) -> None:
        self.arena = arena
        self.schedule = schedule
        self.counts: Counter[str] = Counter()
        for fault in schedule.faults:
            arena.at(fault.at, self._do, fault)
        arena.at(FAULTS_UNTIL_S, self.heal)

    def _target(self, fault: Fault) -> int | None:
        """The id meant, None when nobody is there to be hit."""
        target = fault.targets[0] if fault.targets else WITNESS_ID
        if target == LEADER:
            leaders = self.arena.leaders()
            return leaders[0] if leaders else None
        process = self.arena.processes.get(target)
        return target if process is not None and process.alive else None

    def _do(self, fault: Fault) -> None:
        target = self._target(fault)
        arena, lasts = self.arena, self.arena.now + fault.duration_s
        done = True
        match fault.kind:
            case "kill" if target is not None:
                arena.kill(target, hinted=arena.random.random() < 0.8)
            case "restart" | "witness" if target is not None:
                arena.kill(target)
                arena.at(lasts, self._start, target)
            case "exit" if target is not None:
                arena.exit(target)
                arena.at(lasts + 0.3, self._start, target)
            case "pause" if target is not None:
                arena.pause(target)
                arena.at(lasts, arena.resume, target, fault.value > 0.0)
            case "hand_over" if target is not None:
                arena.hand_over(target)
            case "false_hint" if target is not None:
                seers = [i for i in fault.targets[1:] if i != target and i in arena.ids]
                arena.hint(target, *seers)
                if fault.value > 0.0:
                    arena.latch(target, arena.processes[target].member.incarnation)
                if fault.duration_s > 0.0:
                    arena.at(lasts, self._hint_back, target, arena.processes[target].member, tuple(seers))
            case "gateway" if target is not None and target != WITNESS_ID:
                arena.kill_gateway(target)
                arena.at(lasts, arena.start_gateway, target)
            case "cut" | "cut_one_way" | "cut_pair":
                pairs = self._pairs(fault, target)
                arena.cuts |= pairs
                arena.at(lasts, self._mend, pairs)
                done = bool(pairs)
            case "loss" | "burst" | "duplicate" | "tail":
                name = "loss" if fault.kind == "burst" else fault.kind
                setattr(arena.weather, name, fault.value)
                arena.at(lasts, self._calm, name)
            case _:
                done = False
        self.counts[fault.kind] += done
        if done and arena.trace is not None:
            arena.trace(arena.now, WITNESS_ID if target is None else target, f"# {fault.kind}")

    def _pairs(self, fault: Fault, target: int | None) -> set[tuple[int, int]]:
        ids = set(self.arena.ids)
        if fault.kind == "cut_pair":
            other = fault.targets[1]
            return set() if target is None or target == other else {(target, other), (other, target)}
        side = {i for i in (target if i == LEADER else i for i in fault.targets) if i is not None} & ids
        there = {(a, b) for a in side for b in ids - side}
        return there if fault.kind == "cut_one_way" else there | {(b, a) for a, b in there}

    def _mend(self, pairs: set[tuple[int, int]]) -> None:
        self.arena.cuts -= pairs

    def _calm(self, name: str) -> None:
        setattr(self.arena.weather, name, getattr(self.schedule.weather, name))

    def _start(self, target: int) -> None:
        if not self.arena.processes[target].alive:
            self.arena.start(target)

    def _hint_back(self, target: int, member: Member, seers: tuple[int, ...]) -> None:
        if self.arena.processes[target].member == member and self.arena.processes[target].alive:
            self.arena.hint(target, *seers, up=True)

    def heal(self) -> None:
        """The faults are over: everyone is connected, and a quorum lives (all do when nobody remembers a leader)."""
        arena = self.arena
        arena.cuts.clear()
        calm = self.schedule.weather
        arena.weather.loss, arena.weather.tail, arena.weather.duplicate = 0.0, 0.0, calm.duplicate
        self.schedule.weather.loss = self.schedule.weather.tail = 0.0
        for robot_id in arena.mission.robots:
            if not arena.gateways[robot_id].alive:
                arena.start_gateway(robot_id)
        for target in [i for i in arena.processes if arena.processes[i].paused]:
            arena.resume(target)
        for target in sorted(arena.processes):
            if not arena.processes[target].alive and (self.schedule.revive_all or not self._quorum_lives()):
                arena.start(target)

    def _quorum_lives(self) -> bool:
        living = [p for p in self.arena.processes.values() if p.alive]
        configs = [p.lease.config for p in living if p.lease is not None]
        newest = max(configs, key=lambda c: c.version, default=None)
        robots = any(p.id != WITNESS_ID for p in living)
        return newest is not None and robots and is_quorum(newest, {p.member for p in living})


def play(schedule: Schedule, trace: Trace | None = None) -> Played:
    """Run one schedule on leases and gateways alone. The same schedule gives the same answer, whatever ran before."""
    return _play(schedule, trace, _arena)


def play_whole(schedule: Schedule, trace: Trace | None = None) -> Played:
    """The same with whole agents, witness and world."""
    from deploy.run.whole import Whole

    return _play(schedule, trace, Whole)


def _arena(schedule: Schedule) -> Stage:
    return Arena(
        schedule.robots,
        seed=schedule.seed,
        profile=schedule.profile,
        witness=schedule.witness,
        rates=schedule.rates,
        weather=schedule.weather,
        gateways_at_world=schedule.gateways_at_world,
    )


def _play(schedule: Schedule, trace: Trace | None, stage: Callable[[Schedule], Stage]) -> Played:
    schedule = _copied(schedule)
    arena = stage(_copied(schedule))
    arena.trace = trace
    checkers: list[Checker] = [checker(arena.timing) for checker in SAFETY]
    arena.listen(checkers)
    faults = Faults(arena, schedule)
    arena.start_all()
    arena.run(DURATION_S)
    violations = [v for checker in checkers for v in checker.violations]
    violations += _liveness(arena)
    elections = sum(1 for _, _, effect in arena.log if type(effect).__name__ == "BecomeLeader")
    return Played(schedule, violations, faults.counts, elections, arena)


def _liveness(arena: Stage) -> list[Violation]:
    """L1-L4 at the end of a schedule."""
    at, leaders = arena.now, arena.leaders()
    if len(leaders) != 1:
        return [Violation("L1", at, f"leaders: {leaders}")]
    found = []
    lease = arena.lease_of(leaders[0])
    living = sorted(p.id for p in arena.processes.values() if p.alive)
    robots = [i for i in living if i != WITNESS_ID]
    if sorted(lease.chain) != robots:
        found.append(Violation("L2", at, f"chain {lease.chain}, alive {robots}"))
    versions = {i: arena.lease_of(i).config.version for i in living}
    if len(set(versions.values())) != 1:
        found.append(Violation("L3", at, f"versions {versions}"))
    last = arena.accepted[-1][0] if arena.accepted else 0.0
    if last < at - 0.1:
        found.append(Violation("L4", at, f"last leader command obeyed at {last:.3f}"))
    return found


def _copied(schedule: Schedule) -> Schedule:
    return structs.replace(schedule, weather=structs.replace(schedule.weather))
