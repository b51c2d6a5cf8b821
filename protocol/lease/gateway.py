"""The actuator gateway of one robot: the only path to its actuators, and therefore the place where a lost lease ends.

A false leader does harm by its commands only. So terms are enforced at the actuators, on one clock: a command is obeyed
if its term is not below the highest seen, and if it echoes a time of this gateway's own clock that is not in the future
and younger than the deadman D. A command computed before a pause carries an old time, whatever its sender's state (rule
E12). The world holds the gateways of simulated robots; a real robot's driver holds its own.
"""

from __future__ import annotations

from math import isfinite

from lfa.protocol.fleet_stop.latch import StopLatch
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.incarnations import is_later
from lfa.protocol.lease.term_window import REACH, TermWindow
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import NO_TERM, Fence, Fenced, GatewayStamp, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import UNSAID_GRANT_S, CmdVel, Sensors
from lfa.protocol.mission import Limits

SHUT, OLD_INCARNATION, OLD_TERM, FOREIGN_HOLDER = "shut", "old_incarnation", "old_term", "foreign_holder"
FOREIGN_STAMP, OLD_STAMP, LATCHED, TWO_HOLDERS = "foreign_stamp", "old_stamp", "latched", "two_holders"
FUTURE_STAMP, REORDERED, BAD_TWIST = "future_stamp", "reordered", "bad_twist"
OTHER_TIMING, FAR_TERM = "other_timing", "far_term"


class Gateway:
    """Fence, stamp age check, deadman and latch of robot `robot_id`; `now` is the gateway's own monotonic time [s]."""

    def __init__(
        self,
        robot_id: int,
        incarnation: int,
        timing: Timing,
        now: float,
        limits: Limits | None = None,
        operator_timeout_s: float | None = None,
    ) -> None:
        """Create a gateway that is shut for `T_grant` (E13); `limits` are those of its drive, None without a drive.

        `operator_timeout_s`: as in the mission (E31).
        """
        self.robot_id = robot_id
        self.incarnation = incarnation
        self.term_max: Term = NO_TERM
        self.refused: dict[str, int] = {}
        """Number of refused commands by reason."""
        self.stop = StopLatch(robot_id, incarnation, operator_timeout_s)
        """Fleet stop at this gateway: it obeys commands and knows their terms also while no wheel may turn."""
        self._window = TermWindow()
        self.grant_s = timing.grant_s
        """`T_grant` [s], which follows from `T_act` and D: leases end in time only at gateways that hold the same as
        all voters (E25)."""
        self._deadman_s = timing.deadman_s
        self._limits = limits
        # E13: an earlier incarnation of this gateway may have confirmed a fence unknown to this one. Every lease below
        # that fence has expired after T_grant.
        self._shut_until = now + timing.grant_s
        self.agent: int | None = None
        """Newest known incarnation of the robot's agent; commands of earlier ones are refused (E23)."""
        self._holder = 0
        """Holder of `term_max` named by the obeyed commands; 0: none yet."""
        self._latched: Term | None = None
        self._twist = STILL
        self._stamped_at = float("-inf")
        """Time [s] of this gateway that the last obeyed command echoes; it gives the age of the command's input."""
        self._seq = -1
        """Sequence number of the last obeyed command, in its incarnation."""

    def command(self, cmd: CmdVel, now: float) -> str | None:
        """Obey `cmd` and return None, or count and return the reason of refusal."""
        reason = self._objection(cmd, now)
        if reason is not None:
            self.refused[reason] = self.refused.get(reason, 0) + 1
            return reason
        self.agent, self._seq = cmd.header.incarnation, cmd.header.seq
        if cmd.term > self.term_max:
            self.term_max, self._holder = cmd.term, cmd.holder
            self._window.know(cmd.term.n)
        elif self._holder == 0:
            self._holder = cmd.holder
        self._twist, self._stamped_at = self._within_limits(cmd.twist), cmd.gateway.time
        self.stop.hear_agent(cmd.stop)
        return None

    def _objection(self, cmd: CmdVel, now: float) -> str | None:
        if now < self._shut_until:
            return SHUT
        if cmd.grant_s not in (UNSAID_GRANT_S, self.grant_s):
            return OTHER_TIMING
        if self._knows_later(cmd.header.incarnation):
            return OLD_INCARNATION
        if cmd.term < self.term_max:
            return OLD_TERM
        if cmd.as_leader and cmd.holder != self.robot_id:
            return FOREIGN_HOLDER
        if cmd.term == self.term_max and self._holder not in (0, cmd.holder):
            return TWO_HOLDERS
        if cmd.gateway.incarnation != self.incarnation:
            return FOREIGN_STAMP
        if not cmd.gateway.time <= now:  # nor is nan a time that it has given out
            return FUTURE_STAMP
        if now - cmd.gateway.time > self._deadman_s or cmd.gateway.time < self._stamped_at:
            return OLD_STAMP
        if cmd.gateway.time == self._stamped_at and cmd.header.incarnation == self.agent and cmd.header.seq < self._seq:
            return REORDERED
        if not (isfinite(cmd.twist.linear_x) and isfinite(cmd.twist.angular_z)):
            return BAD_TWIST
        if cmd.as_leader and self._latched is not None and cmd.term <= self._latched:
            return LATCHED
        return FAR_TERM if cmd.term.n > REACH else None

    def _within_limits(self, twist: Twist) -> Twist:
        """Return `twist` [m/s, rad/s], each part limited to what the drive can do."""
        if self._limits is None:
            return twist
        v = min(max(twist.linear_x, -self._limits.v_reverse_max_mps), self._limits.v_max_mps)
        omega_max = self._limits.omega_max_radps
        omega = min(max(twist.angular_z, -omega_max), omega_max)
        return twist if (v, omega) == (twist.linear_x, twist.angular_z) else Twist(v, omega)

    def fence(self, fence: Fence, now: float) -> Fenced:
        """Refuse all terms below `fence.term` from now on, brake if it is new, and return the confirmation (E11).

        A term that is too far ahead is not believed (E26): the answer then confirms the highest seen, and no old one.
        """
        if not self._window.believes(fence.term.n, now):
            return Fenced(NO_TERM, self.term_max)
        if fence.term > self.term_max:
            self.term_max, self._holder = fence.term, 0
            self._twist = STILL
        return Fenced(fence.old, fence.term)

    def agent_down(self, incarnation: int, now: float) -> None:
        """Brake, and bar leader commands of the disconnected agent up to the current term (E14).

        Follower commands are not barred: a vanished token proves nothing, and a follower does no harm. Not to be
        called when the gateway's own link to the router is lost too: that says nothing about the agent.
        """
        if not self._knows_later(incarnation):
            self.agent, self._latched = incarnation, self.term_max
            self._twist = STILL

    def agent_up(self, incarnation: int, now: float) -> None:
        """Record that an agent of this robot is connected; a newer incarnation replaces the obeyed one; stop then."""
        if incarnation != self.agent and not self._knows_later(incarnation):
            self.agent = incarnation
            self._twist = STILL

    def _knows_later(self, incarnation: int) -> bool:
        return self.agent is not None and is_later(self.agent, incarnation)

    @property
    def latched(self) -> bool:
        """True if leader commands of `term_max` are barred."""
        return self._latched is not None and self._latched >= self.term_max

    def sensors(self, header: Header, pose_odom: Pose2D, twist: Twist, odometer_m: float, now: float) -> Sensors:
        """Return the message of a robot's odometry, with what this gateway tells its agent at `now`."""
        return Sensors(
            header,
            pose_odom,
            twist,
            odometer_m,
            self.stamp(now),
            self.term_max,
            self.latched,
            sum(self.refused.values()),
            self.agent,
            self.stop.known,
            self.stop.holds(now),
            self.grant_s,
        )

    def stamp(self, now: float) -> GatewayStamp:
        """Return the present time of this gateway, to be echoed in the commands computed from it."""
        return GatewayStamp(self.incarnation, now)

    def twist(self, now: float) -> Twist:
        """Return the velocity for the actuators: the last obeyed command, or a stop once the deadman has expired, and
        while the fleet is stopped (E28).

        The deadman counts from the time that the command echoes, not from its arrival: a delayed command could
        otherwise move the robot up to 2 D after its sender's lease, and T_grant allows for one D (I8).
        """
        if self.stop.holds(now) or now - self._stamped_at > self._deadman_s:
            return STILL
        return self._twist
