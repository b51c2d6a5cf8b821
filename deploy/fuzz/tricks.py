"""Faults of a fuzz schedule that are rare and broad: everything off at once, made-up terms, times to come, and other
versions of the messages. On leases and gateways only.
"""

from __future__ import annotations

from lfa.deploy.analysis.verification.checker import Checker
from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.deploy.fuzz.schedules import FAULTS_UNTIL_S, MADE_UP_TERMS, ScheduledFault
from lfa.protocol.lease.agreement import agreement_of, digest
from lfa.protocol.messages.consensus import Fence, LeaseBody, Member, Prepare, Release, Term, Version
from lfa.protocol.messages.header import WIRE_VERSION


class Tricks:
    """Tricks of one simulation; `begin` schedules them. `done` counts those that took effect."""

    def __init__(self, team: LeaseSimulation, until_s: float = FAULTS_UNTIL_S) -> None:
        """`until_s`: time [s] at which the effects of all tricks end at the latest."""
        self._team = team
        self._until_s = until_s
        self.done = 0

    def begin(self, tricks: tuple[ScheduledFault, ...]) -> None:
        """Schedule the tricks; the effects of each end with the faults at the latest."""
        for trick in tricks:
            self._team.at(trick.at, self._do, trick)

    def _do(self, trick: ScheduledFault) -> None:
        team, lasts = self._team, min(self._team.now + trick.duration_s, self._until_s)
        if trick.kind == "blackout":
            self._blackout(trick, lasts)
        elif team.processes[trick.targets[0]].alive:
            match trick.kind:
                case "made_up":
                    self._make_up(trick.targets[0], MADE_UP_TERMS[round(trick.value)])
                case "ahead":
                    team.command_ahead(trick.targets[0], trick.value)
                case _:
                    self._other_version(trick.targets[0], lasts)
        self.done += 1
        if team.trace is not None:
            team.trace(team.now, trick.targets[0] if trick.targets else 0, f"# {trick.kind}")

    def _blackout(self, trick: ScheduledFault, lasts: float) -> None:
        """Kill every process, and the gateways of the targets; all start again, on clocks that are wrong by `value`."""
        team = self._team
        ended = [i for i in team.ids if team.processes[i].alive]
        for i in ended:
            team.kill(i)
            if trick.value:
                team.step_wall(i, trick.value)
            team.at(lasts, self._start, i)
        for robot in trick.targets:
            team.kill_gateway(robot)
            team.at(lasts, self._start_gateway, robot)

    def _start(self, target: int) -> None:
        if not self._team.processes[target].alive:
            self._team.start(target)

    def _start_gateway(self, robot: int) -> None:
        if not self._team.gateways[robot].alive:
            self._team.start_gateway(robot)

    def _make_up(self, robot: int, number: int) -> None:
        """Let a robot say PREPARE and RELEASE to all, and FENCE to all gateways, of a term with that number (E26)."""
        team, source = self._team, self._team.processes[robot]
        team.report(Checker.wall_steps, team.now, robot)  # as a clock of another century would: it may be the highest
        term = Term(number, robot, source.member.incarnation)
        asked = Prepare(term, Version(term, 0), agreed=source.lease.agreed, wire=WIRE_VERSION)
        said: tuple[LeaseBody, ...] = (asked, Release(term))
        for process in list(team.processes.values()):
            for body in said if process.alive and process is not source else ():
                team.hear(process, source.member, body)
        for other in team.robots:
            team.fence(other, Fence(term, term))

    def _other_version(self, target: int, lasts: float) -> None:
        """Restart a process with messages of a version that its team cannot read (E35), until `lasts` [s]."""
        team = self._team
        team.start(target)
        member = team.processes[target].member
        team.foreign.add(member)
        agreed = digest(agreement_of(team.mission, team.timing))
        team.report(Checker.holds, team.now, member, agreed + 1)
        team.report(Checker.speaks, team.now, member)
        team.at(lasts, self._right_version, target, member)

    def _right_version(self, target: int, foreign: Member) -> None:
        if self._team.processes[target].member == foreign:
            self._team.start(target)
