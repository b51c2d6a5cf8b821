"""Execution of one schedule of the fleet stop alone, in virtual time, with the checkers of its invariants."""

from __future__ import annotations

from collections import Counter

from lfa.deploy.analysis.causes.broken_rules import RuleWatch
from lfa.deploy.analysis.verification.fleet_stop import LatchKept, StopHolds
from lfa.deploy.fuzz.fault_injector import Played
from lfa.deploy.fuzz.fleet_stop.stop_schedules import DURATION_S, FAULTS_UNTIL_S
from lfa.deploy.fuzz.fleet_stop.stop_team import StopTeam
from lfa.deploy.fuzz.link_faults import LinkFaults, target_of
from lfa.deploy.fuzz.network import Trace
from lfa.deploy.fuzz.schedules import Schedule, ScheduledFault
from lfa.deploy.fuzz.stops import StopQuestions, StopTraffic

APART_S = 0.3
"""Longest time [s] between the starts of the agent and of the gateway of a robot that reboots."""


class StopFaults:
    """Injector of a schedule's faults into a team: counts those that took effect, then heals."""

    def __init__(self, team: StopTeam, schedule: Schedule) -> None:
        self._team = team
        self._links = LinkFaults(team, schedule.radio)
        self.counts: Counter[str] = Counter()
        for fault in schedule.faults:
            team.at(fault.at, self._do, fault)
        team.at(FAULTS_UNTIL_S, self._heal)

    def _do(self, fault: ScheduledFault) -> None:
        team, target = self._team, target_of(self._team, fault)
        lasts, done = team.now + fault.duration_s, target is not None
        match fault.kind:
            case "kill" if target is not None:
                team.kill(target)
            case "restart" if target is not None:
                team.kill(target)
                team.at(lasts, team.start, target)
            case "gateway" if target is not None:
                team.kill_gateway(target)
                team.at(lasts, team.start_gateway, target)
            case "reboot" if target is not None:
                self._reboot(target, lasts)
            case "pause" if target is not None:
                team.pause(target)
                team.at(lasts, team.resume, team.processes[target])
            case "hand_over" if target is not None:
                team.hand_over(target)
            case _:
                done = self._links.disturb(fault, target, lasts)
        self.counts[fault.kind] += done
        if done and team.trace is not None:
            team.trace(team.now, target or 0, f"# {fault.kind}")

    def _reboot(self, robot: int, at: float) -> None:
        """End agent and gateway of a robot, and start them from true time `at` [s] on, in either order."""
        team = self._team
        team.kill(robot)
        team.kill_gateway(robot)
        team.at(at + team.random.choice((0.0, APART_S)) * team.random.random(), team.start, robot)
        team.at(at, team.start_gateway, robot)

    def _heal(self) -> None:
        """End all faults: everybody is connected and runs."""
        team = self._team
        team.heal()
        self._links.calm_all()
        for robot in team.robots:
            team.start_gateway(robot)
            team.start(robot)
            if team.processes[robot].paused:
                team.resume(team.processes[robot])


def play_stops(schedule: Schedule, trace: Trace | None = None) -> Played:
    """Run one schedule. The result depends on the schedule alone, not on earlier runs."""
    team = StopTeam(schedule)
    team.trace = trace
    watch = RuleWatch(team.timing)
    checkers = [watch, StopHolds(team.timing), LatchKept(team.timing, schedule.operator_timeout_s)]
    for checker in checkers:
        checker.told = watch.note
    traffic = StopTraffic(team, team.robots, schedule.seed)
    team.listen([*checkers, traffic.observer])
    team.start_all()
    faults = StopFaults(team, schedule)
    StopQuestions(team, team.robots, traffic.links)
    traffic.begin(schedule.stops)
    team.run(DURATION_S)
    violations = [violation for checker in checkers for violation in checker.violations]
    broken = next((rule for _, rule in watch.broken_rules if rule is not None), None)
    return Played(schedule, violations, faults.counts, team.elections, team, traffic.outcomes, broken)
