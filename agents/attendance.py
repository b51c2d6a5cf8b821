"""Who of the team is there and outside of the chain, and whether this robot lacks messages of its team (E27)."""

from __future__ import annotations

from lfa.agents.team_state import TeamState
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.membership import team_of
from lfa.protocol.messages.consensus import Role
from lfa.protocol.names import robot_name

HELLO_S_MAX = 3.0
"""Age [s] of a HELLO beyond which its sender is not heard: outside of the chain it is sent eight times a second."""
LACKING_SHARE = 2.0
"""Age of a table row beyond which its sender is not heard, in units of the age up to which it counts."""
OUTSIDE_S = 2.0
"""Time [s] outside of the chain after which a robot is told of: joining it takes less."""
UNHEARD = "no HELLO is heard of it"


class Attendance:
    """Attendance of the team at one robot, renewed once a second by `update`."""

    def __init__(self, robot_id: int, robots: tuple[int, ...]) -> None:
        self._id = robot_id
        self._robots = robots
        self._since: dict[int, float] = {}
        """Time [s] from which each robot that is there has been outside of the chain."""
        self.lacks_messages = True
        """True while this robot has no leader, is in no chain, or does not hear what its team sends."""
        self.outside: dict[int, str] = {}
        """Why each robot that is there is not in the own chain, as its leader sees it; empty for other robots."""

    def update(self, lease: Lease, team: TeamState, now: float) -> None:
        chain = lease.chain
        if lease.role is not Role.LEADER:
            self._since.clear()
            self.outside = {}
            self.lacks_messages = lease.leader is None or self._id not in chain or self._misses_rows(chain, team, now)
            return
        members = team_of(lease.config.roster, self._robots)
        outside = [robot for robot in members if robot not in chain and _is_there(robot, lease, team, now)]
        self._since = {robot: self._since.get(robot, now) for robot in outside}
        late = [robot for robot in outside if now - self._since[robot] >= OUTSIDE_S]
        self.outside = {robot: _why_outside(robot, lease, now) for robot in late}
        unheard = UNHEARD in self.outside.values()
        self.lacks_messages = unheard or self._misses_rows(chain, team, now)

    def _misses_rows(self, chain: tuple[int, ...], team: TeamState, now: float) -> bool:
        lacking_s = LACKING_SHARE * team.report_s_max
        return any(team.row_age(robot, now) > lacking_s for robot in chain if robot != self._id)

    def text(self) -> str:
        """Return who is outside and why, in words; empty if nobody is."""
        return ", ".join(f"{robot_name(robot)} not in the chain: {why}" for robot, why in self.outside.items())


def _is_there(robot: int, lease: Lease, team: TeamState, now: float) -> bool:
    """Return True if anything shows that `robot` runs: its token, its table row, its HELLO."""
    return is_heard(robot, lease, now) or team.row_age(robot, now) <= team.report_s_max


def is_heard(robot: int, lease: Lease, now: float) -> bool:
    """Return True if the token of `robot` is there, or its HELLO was heard lately."""
    hello = lease.hello_of(robot)
    return lease.peers.is_here(robot) or (hello is not None and now - hello[1] <= HELLO_S_MAX)


def _why_outside(robot: int, lease: Lease, now: float) -> str:
    """Return the reason why a robot that is there is not in the leader's chain."""
    hello = lease.hello_of(robot)
    if hello is None or now - hello[1] > HELLO_S_MAX:
        return UNHEARD
    member = hello[0]
    later = lease.peers.later_than(member)
    if later is not None:
        return f"its HELLO is of incarnation {member.incarnation}, which {later} has replaced"
    if robot in lease.left_out:
        return "left out, for it reports to be stuck or without a pose"
    if lease.peers.is_gone(member):
        return "its HELLO is heard, but its token vanished"
    return "its HELLO is heard, to be taken in"
