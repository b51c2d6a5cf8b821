"""The actuator gateway of one robot: the only way to its motors, and therefore the place where a lost lease ends.

Believing that one leads harms nobody; commanding does. So terms are enforced here, last, on one clock: a command
is obeyed when its term is not below the highest seen, and when it echoes a moment of this gateway's own clock
that is younger than the deadman D. A command computed before a pause carries an old moment, whatever its sender
has believed since (rule E12). The world holds the gateways of the robots that it simulates, a robot's driver its own.
"""

from __future__ import annotations

from lfa.protocol.geometry import STILL, Twist
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import NO_TERM, Fence, Fenced, GatewayStamp, Term
from lfa.protocol.messages.robot import CmdVel

SHUT, OLD_INCARNATION, OLD_TERM, FOREIGN_HOLDER = "shut", "old_incarnation", "old_term", "foreign_holder"
FOREIGN_STAMP, OLD_STAMP, LATCHED, TWO_HOLDERS = "foreign_stamp", "old_stamp", "latched", "two_holders"


class Gateway:
    """Term fence, stamp age, deadman and latch of robot `robot_id`; `now` is the gateway's own monotonic time [s]."""

    def __init__(self, robot_id: int, incarnation: int, timing: Timing, now: float) -> None:
        self.robot_id = robot_id
        self.incarnation = incarnation
        self.term_max: Term = NO_TERM
        self.refused: dict[str, int] = {}
        """Refused commands by reason."""
        self._deadman_s = timing.deadman_s
        # E13: an earlier life of this gateway may have promised a fence that this one does not know of. Every lease
        # that could be under that fence has run out after T_grant.
        self._shut_until = now + timing.grant_s
        self._obeyed = 0
        """The newest incarnation of the robot's agent that was heard of: the only one that is obeyed."""
        self._holder = 0
        """Whom leader and followers of `term_max` named as its holder; 0: nobody yet."""
        self._latched: Term | None = None
        self._twist = STILL
        self._stamped_at = float("-inf")
        """The moment of this gateway that the last obeyed command echoes: how old the information is that moves it."""

    def command(self, cmd: CmdVel, now: float) -> str | None:
        """Obey `cmd` and answer None, or answer (and count) the reason of refusal."""
        reason = self._objection(cmd, now)
        if reason is not None:
            self.refused[reason] = self.refused.get(reason, 0) + 1
            return reason
        self._obeyed = cmd.header.incarnation
        if cmd.term > self.term_max:
            self.term_max, self._holder = cmd.term, cmd.holder
        elif self._holder == 0:
            self._holder = cmd.holder
        if cmd.as_leader:
            self._latched = None
        self._twist, self._stamped_at = cmd.twist, cmd.gateway.time
        return None

    def _objection(self, cmd: CmdVel, now: float) -> str | None:
        if now < self._shut_until:
            return SHUT
        if cmd.header.incarnation < self._obeyed:
            return OLD_INCARNATION
        if cmd.term < self.term_max:
            return OLD_TERM
        if cmd.as_leader and cmd.holder != self.robot_id:
            return FOREIGN_HOLDER
        if cmd.term == self.term_max and self._holder not in (0, cmd.holder):
            return TWO_HOLDERS
        if cmd.gateway.incarnation != self.incarnation:
            return FOREIGN_STAMP
        if now - cmd.gateway.time > self._deadman_s or cmd.gateway.time < self._stamped_at:
            return OLD_STAMP
        if cmd.as_leader and self._latched is not None and cmd.term <= self._latched:
            return LATCHED
        return None

    def fence(self, fence: Fence, now: float) -> Fenced:
        """E11: from here on nothing below `fence.term` moves this robot, and what moved it so far is braked."""
        if fence.term > self.term_max:
            self.term_max, self._holder = fence.term, 0
            self._twist = STILL
        return Fenced(fence.old, fence.term)

    def agent_down(self, incarnation: int, now: float) -> None:
        """E14: the robot's agent left the wire. Its leader commands are barred below the next term, at once.

        A follower's commands are not: a token that vanished is a hint, and a follower harms nobody. Not to be
        called when the gateway's own link to the router is gone too: that says nothing about the agent.
        """
        if incarnation >= self._obeyed:
            self._obeyed, self._latched = incarnation, self.term_max
            self._twist = STILL

    def agent_up(self, incarnation: int, now: float) -> None:
        """An agent of this robot is on the wire; a newer life than the one obeyed replaces it."""
        if incarnation > self._obeyed:
            self._obeyed = incarnation
            self._twist = STILL

    @property
    def latched(self) -> bool:
        """Leader commands of `term_max` are barred."""
        return self._latched is not None and self._latched >= self.term_max

    def stamp(self, now: float) -> GatewayStamp:
        """This moment, to be echoed in the commands that are computed from it."""
        return GatewayStamp(self.incarnation, now)

    def twist(self, now: float) -> Twist:
        """What the motors get: the last command obeyed, or a stop once the deadman has run out.

        The deadman runs from the moment that the command echoes, not from its arrival: a command that was long on
        its way would otherwise move the robot up to 2 D after its sender's lease, and T_grant allows for one (I8).
        """
        return self._twist if now - self._stamped_at <= self._deadman_s else STILL
