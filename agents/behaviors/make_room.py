"""Behaviour of a follower in a narrow place whose predecessor comes back: it backs along its trail until there is room.

A leader turns back out of a dead end, or is a new one whose way lies behind its own team. Where it can pass beside its
follower it does; where it cannot, somebody has to go back, and only the last one can begin. The robots behind need no
word about it: a predecessor that reverses towards them needs room as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, hypot, inf, pi

from lfa.agents.avoidance.decision import Action, Decision
from lfa.agents.following.predecessor import Sighting
from lfa.agents.perception.scan import Point
from lfa.agents.recovery.back_up import BEYOND_M, BackUp, back_to
from lfa.protocol.geometry import STILL, Pose2D, Twist, distance, in_base

FACES_RAD, COMES_S = 0.8, 0.6
"""Angle [rad] off its heading, or off its rear while it reverses, within which a predecessor comes towards this robot,
and the time [s] for which it must."""
TOUCHES_M = 0.15
"""Room [m] between both bodies below which it needs room whichever way it turns, but away."""
GONE_S, HOLD_S = 1.5, 10.0
"""Time [s] for which it must have turned away until its follower follows again, and for which this one stands while it
neither comes nor has turned away: it looks for its way."""
REVERSES_MPS = -0.02
RESTS_MPS, RESTS_RADPS = 0.01, 0.02
"""Speeds below which a predecessor rests: where both stand for `HOLD_S`, it does not come, whichever way it faces."""
NEAR_BODIES, NEAR_M, CLEAR_M = 2.0, 0.8, 0.2
"""Distance within which it comes near: this number of bodies, and this room [m] between them; and the room [m] beyond
that at which its follower stands."""
BESIDE_M, PASSES_M = 0.6, 0.15
"""Length [m] of the ground beside this robot that has to be free for a pass, and the room [m] beside both bodies."""
ROOM_S = 60.0
"""Longest time [s] for which a follower makes room; then its law takes over until the predecessor has turned away."""
ROOM = Decision(Action.MAKE_ROOM, inf, pi, "wall", "the predecessor comes back through a narrow place", "angle")
"""Decision of a follower that makes room, for the log."""


class MakeRoom:
    """Room that one follower makes for its predecessor."""

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m
        self._near_m = NEAR_BODIES * radius_m + NEAR_M
        self._path = BackUp()
        self._comes_since: float | None = None
        self._came_at = -inf
        self._made = False
        """True from the first twist that makes room until the predecessor has gone."""
        self._moved_at: float | None = None
        """Time [s] at which this robot made room by moving, or its predecessor moved."""

    def end(self) -> None:
        """Forget the predecessor: the robot has another one, or another role."""
        self._moved_at = None
        self._stop()

    def _stop(self) -> None:
        """Make no room any more: nobody comes."""
        self._comes_since, self._made = None, False
        self._path.end()

    def step(self, sighting: Sighting, points: Sequence[Point], pose: Pose2D, now: float) -> Twist | None:
        """Return the twist backwards, still where that is barred or not needed now; None while nobody needs room.
        `points` are what stands, in `base_link`.
        """
        rests = abs(sighting.twist.linear_x) < RESTS_MPS and abs(sighting.twist.angular_z) < RESTS_RADPS
        if not rests or self._moved_at is None:
            self._moved_at = now
        if now - self._moved_at >= HOLD_S:
            self._stop()
            return None
        twist = self._made_room(sighting, points, pose, now)
        if twist is not None and twist != STILL:
            self._moved_at = now
        return twist

    def _made_room(self, sighting: Sighting, points: Sequence[Point], pose: Pose2D, now: float) -> Twist | None:
        if self._comes(sighting, pose):
            self._came_at = now
            self._comes_since = now if self._comes_since is None else self._comes_since
        elif now - self._came_at >= self._patience_s(sighting, pose):
            self._stop()
        came_s = 0.0 if self._comes_since is None else now - self._comes_since
        needed = COMES_S <= came_s < ROOM_S and self._is_narrow(sighting, points, pose)
        if came_s >= ROOM_S:
            self._path.end()
        elif needed:
            self._path.begin(pose)
        if self._path.under_way and distance(sighting.pose, pose) > self._near_m + CLEAR_M:
            return STILL
        twist = self._path.step(points, pose, self._radius_m)
        if twist is None and needed:  # its trail ends here
            twist = back_to(points, (-BEYOND_M, 0.0), self._radius_m)
        if twist is not None:
            self._made = True
            return twist
        if self._made and came_s < ROOM_S:
            return STILL
        self._path.keep(pose)
        return None

    def _patience_s(self, sighting: Sighting, pose: Pose2D) -> float:
        """Return the time [s] for which this robot holds the room that it has made."""
        if not self._made:
            return 0.0
        x, _ = in_base(sighting.pose, (pose.x, pose.y))
        return GONE_S if x < 0.0 else HOLD_S

    def _comes(self, sighting: Sighting, pose: Pose2D) -> bool:
        """Return whether the predecessor is near and ahead, and faces this robot or reverses towards it."""
        if in_base(pose, (sighting.pose.x, sighting.pose.y))[0] <= 0.0:
            return False
        x, y = in_base(sighting.pose, (pose.x, pose.y))
        if sighting.twist.linear_x < REVERSES_MPS:
            x, y = -x, -y
        apart_m, off_rad = hypot(x, y), abs(atan2(y, x))
        touches = apart_m < NEAR_BODIES * self._radius_m + TOUCHES_M and off_rad < pi / 2
        return touches or (apart_m < self._near_m and off_rad < FACES_RAD)

    def _is_narrow(self, sighting: Sighting, points: Sequence[Point], pose: Pose2D) -> bool:
        """Return whether a body passes this robot at neither side."""
        mate_x, mate_y = in_base(pose, (sighting.pose.x, sighting.pose.y))
        away = [(x, y) for x, y in points if hypot(x - mate_x, y - mate_y) > self._radius_m + PASSES_M]
        beside = [y for x, y in away if abs(x) < BESIDE_M]
        left_m = min((y for y in beside if y > 0.0), default=inf)
        right_m = min((-y for y in beside if y < 0.0), default=inf)
        return max(left_m, right_m) < 3.0 * self._radius_m + PASSES_M
