"""Free place beside a slot on which something stands, for a follower whose predecessor is at rest.

A detour leads round an obstacle and back to its target; to a target inside of the obstacle it would lead for ever.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, hypot, inf

from lfa.agents.leading.free_place import FreePlace
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import STILL, Pose2D, Twist, in_base

RESTS_MPS = 0.01
HIDDEN_S, HIDDEN_M = 5.0, 0.5
"""Time [s] for which a surface must be seen before the slot, at most this far [m] from it, until the slot counts as
inside of the thing: only the near side of an obstacle is seen."""
MOVED_M = 0.15
"""Motion [m] of the slot after which a follower that stands beside it drives again."""
CIRCLED_M, CIRCLED_S, PAUSE_S = 0.3, 8.0, 5.0
"""Distance [m] to a free slot within which detours that begin anew, at most `PAUSE_S` [s] apart, lead round it for ever
when something stands close beside it; and the time [s] after which the robot stands instead."""
STANDS_M = 0.15
"""Distance [m] to the slot at which it then stands."""
VISITS, LEFT_M, AS_NEAR_M = 2, 0.2, 0.1
"""Times that a robot has come within reach of a resting slot, and has gone more than `LEFT_M` [m] beyond that again;
when it comes once more, something stands in its way there, and it stays where it is as near as ever, to `AS_NEAR_M`."""
THERE_M, BESIDE_M = 0.05, 0.05
TURN_GAIN, IN_PLACE_RAD, TURN_RADPS = 2.0, 0.6, 0.8
SPEED_GAIN_PER_S, SPEED_MPS = 0.8, 0.25


class FreeSlot:
    """Place of one follower at rest, where its slot is taken."""

    def __init__(self, radius_m: float) -> None:
        self._free_place = FreePlace(radius_m)
        self._hidden_since: float | None = None
        self._stands_for: Point | None = None
        """Slot in `map` beside which the robot stands; None while it drives."""
        self._hindered: tuple[float, float] | None = None
        """Times [s] of the first and of the latest detour close to the slot; None where there was none of late."""
        self._visits, self._near, self._least_m = 0, False, inf
        """Times that the robot has come near the slot at rest, whether it is there now, and how near [m] it got."""

    def end(self) -> None:
        """Forget the place: the slot moves, or the robot has another predecessor or role."""
        self._stands_for = self._hidden_since = self._hindered = None
        self._visits, self._near, self._least_m = 0, False, inf
        self._free_place.reset()

    def steer(
        self,
        slot: Point,
        points: Sequence[Point],
        pose: Pose2D,
        ahead_mps: float,
        within_m: float,
        now: float,
        *,
        hindered: bool = False,
    ) -> Twist | None:
        """Return the twist to the free place nearest to `slot` (in `map`), still once there; None where the slot is
        free, no place within `within_m` of it is, or the predecessor drives at `ahead_mps`. `points` are in
        `base_link`; `hindered` while a detour leads the robot.
        """
        if abs(ahead_mps) > RESTS_MPS:
            self.end()
            return None
        if self._stands_for is not None:
            if hypot(slot[0] - self._stands_for[0], slot[1] - self._stands_for[1]) < MOVED_M:
                return STILL
            self._stands_for = None
        center = in_base(pose, slot)
        apart_m = hypot(*center)
        if self._circles(apart_m, now, hindered=hindered) or self._returns(apart_m, within_m):
            self._stands_for, self._hindered = slot, None
            return STILL
        if not _hidden(center, points):
            self._hidden_since = None
        elif self._hidden_since is None:
            self._hidden_since = now
        elif now - self._hidden_since >= HIDDEN_S:
            points = [*points, center]
        place = self._free_place.look(slot, points, pose, now)
        if place is None or hypot(place[0] - slot[0], place[1] - slot[1]) > within_m:
            return None
        x, y = in_base(pose, place)
        if hypot(x, y) < THERE_M:
            self._stands_for = slot
            return STILL
        return _towards(x, y)

    def _circles(self, apart_m: float, now: float, *, hindered: bool) -> bool:
        """Return whether detours have led the robot round a slot `apart_m` [m] away for long, and it is close enough to
        stand.
        """
        if apart_m > CIRCLED_M or (self._hindered is not None and now - self._hindered[1] > PAUSE_S):
            self._hindered = None
        elif hindered:
            self._hindered = (now if self._hindered is None else self._hindered[0], now)
        return self._hindered is not None and now - self._hindered[0] >= CIRCLED_S and apart_m < STANDS_M

    def _returns(self, apart_m: float, within_m: float) -> bool:
        """Return whether the robot has come within `within_m` of its slot again and again, and is `apart_m` from it
        now, about as near as it ever was.
        """
        if apart_m > within_m + LEFT_M:
            self._near = False
        elif apart_m <= within_m and not self._near:
            self._near = True
            self._visits += 1
        if self._visits > VISITS:
            return apart_m <= min(self._least_m + AS_NEAR_M, within_m)
        self._least_m = min(self._least_m, apart_m)
        return False


def _towards(x: float, y: float) -> Twist:
    """Return the twist to a place at (`x`, `y`) [m] in `base_link`: a turn on the spot first, where it lies aside."""
    bearing = atan2(y, x)
    if abs(bearing) > IN_PLACE_RAD:
        return Twist(0.0, TURN_RADPS if bearing > 0.0 else -TURN_RADPS)
    return Twist(min(SPEED_MPS, SPEED_GAIN_PER_S * hypot(x, y)), TURN_GAIN * bearing)


def _hidden(place: Point, points: Sequence[Point]) -> bool:
    """Return whether `place` lies close behind a surface, as seen from the robot."""
    x, y = place
    far_m = hypot(x, y)
    if far_m < THERE_M:
        return False
    for px, py in points:
        along, across = (x * px + y * py) / far_m, (x * py - y * px) / far_m
        if 0.0 < far_m - along < HIDDEN_M and abs(across) < BESIDE_M and along > 0.0:
            return True
    return False
