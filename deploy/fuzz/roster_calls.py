"""Operators of a fuzz schedule who let spares join and robots retire (E33, E34), as `lfa join` and `lfa retire` do.

Each call is repeated to the leader of the moment, until the change is in a config that quorums have accepted.
"""

from __future__ import annotations

from lfa.deploy.fuzz.lease_processes import Process
from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.deploy.fuzz.schedules import FAULTS_UNTIL_S, ScheduledFault
from lfa.protocol.errors import Refused
from lfa.protocol.lease.membership import joined, retired, team_of

REPEAT_S = 0.1


class RosterCalls:
    """Calls of operators in one simulation; `begin` schedules them. `done` counts those that were carried out."""

    def __init__(self, team: LeaseSimulation, until_s: float = FAULTS_UNTIL_S) -> None:
        """`until_s`: time [s] from which no call is repeated."""
        self._team = team
        self._until_s = until_s
        self.done = 0

    def begin(self, calls: tuple[ScheduledFault, ...]) -> None:
        """Schedule the calls; none is repeated after the last fault."""
        for call in calls:
            self._team.at(call.at, self._say, call)

    def _say(self, call: ScheduledFault) -> None:
        team = self._team
        leads = [team.processes[i] for i in team.leaders() if not team.processes[i].paused]
        for process in leads:
            if self._obeyed(process, call):
                self.done += 1
                return
        if team.now + REPEAT_S < min(call.at + call.duration_s, self._until_s):
            team.at(team.now + REPEAT_S, self._say, call)

    def _obeyed(self, process: Process, call: ScheduledFault) -> bool:
        """Ask a leader; return True if the change is made and accepted."""
        lease, robots, robot = process.lease, self._team.mission.robots, call.targets[0]
        roster = lease.config.roster
        if (robot in team_of(roster, robots)) == (call.kind == "join"):
            return lease.is_committed
        if robot == process.id:
            self._team.hand_over(robot)
            return False
        try:
            newer = (
                joined(roster, robots, lease.chain, robot, round(call.value))
                if call.kind == "join"
                else retired(roster, robots, lease.chain, robot)
            )
        except Refused:
            return True
        local = process.clock.local(self._team.now)
        self._team.carry_out(process, lease.request_roster(newer, local))
        return False
