"""Slot of a follower that cannot get to it while its predecessor rests: swung about the predecessor to a free place.

Something stands on the slot, or lies round it: a detour to it would lead for ever. Or the predecessor's trace, which
turned back on itself, ends beside its body. The distance k^d is kept, and phi^d or the trace is given up until the
predecessor drives on.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, inf, pi, sin

from msgspec.structs import replace

from lfa.protocol.geometry import Point, Pose2D, in_base, wrap
from lfa.protocol.messages.team import Slot

RESTS_MPS = 0.01
NEAR_M, OUT_S, LOOK_S = 3.0, 20.0, 1.0
"""Distance [m] to the slot from which the time counts, time [s] out of it behind a predecessor at rest after which a
follower swings it, and time [s] between two looks for a free place."""
STEP_RAD, STEPS = pi / 12, 10
"""Step of the swing, and how many of them are tried to either side."""
CLEAR_M, SEEN_M, BESIDE_M = 0.08, 1.6, 0.05
"""Clearance [m] beside the body at a free place, distance [m] up to which the points of a scan tell whether one is
free, and the distance [m] of a point beside the line of sight that hides it."""


class SwungSlot:
    """Angle phi [rad] of one follower's slot, once that was swung."""

    def __init__(self, radius_m: float) -> None:
        self._clear_m = radius_m + CLEAR_M
        self._asked: Slot | None = None
        """Slot that was asked for last."""
        self._phi: float | None = None
        self._asked_rad = 0.0
        """Direction [rad] in `map` from the predecessor to the slot as it was asked for."""
        self._tried: set[int] = set()
        self._look_at = inf
        """Time [s] from which it looks for a free place; inf while it is in its slot."""

    @property
    def is_swung(self) -> bool:
        return self._phi is not None

    def end(self) -> None:
        """Give the swing up: the robot has another slot, another predecessor, or another role."""
        self._phi, self._look_at = None, inf
        self._tried.clear()

    def swung(
        self,
        slot: Slot,
        place: Point,
        ahead: Pose2D,
        chi: float,
        ahead_mps: float,
        points: Sequence[Point],
        pose: Pose2D,
        within_m: float,
        now: float,
    ) -> Slot:
        """Return `slot`, swung about the predecessor when the robot has been farther than `within_m` from it for long.

        `place` is where the slot, as swung so far, lies in `map`, `ahead` is the predecessor's pose, `chi` [rad] the
        heading that phi counts from; `points` are in `base_link`.
        """
        if abs(ahead_mps) > RESTS_MPS or slot != self._asked:
            self._asked = slot
            self.end()
            return slot
        apart_m = hypot(place[0] - pose.x, place[1] - pose.y)
        if apart_m <= within_m:
            self._look_at = inf
        elif apart_m <= NEAR_M and self._look_at == inf:
            self._look_at = now + OUT_S
        elif now >= self._look_at:
            if self._phi is None:
                self._asked_rad = atan2(place[1] - ahead.y, place[0] - ahead.x)
            turned_rad = self._free_rad(slot.separation_m, ahead, points, pose)
            self._look_at = now + (LOOK_S if turned_rad is None else OUT_S)
            self._phi = self._phi if turned_rad is None else wrap(turned_rad - chi)
        return slot if self._phi is None else replace(slot, phi=self._phi)

    def _free_rad(self, separation_m: float, ahead: Pose2D, points: Sequence[Point], pose: Pose2D) -> float | None:
        """Return the direction [rad] in `map` of the free place nearest to the slot that was not tried; None: none."""
        for n in sorted(range(-STEPS, STEPS + 1), key=abs):
            angle = self._asked_rad + n * STEP_RAD
            there = ahead.x + separation_m * cos(angle), ahead.y + separation_m * sin(angle)
            if n not in self._tried and self._is_free(in_base(pose, there), points):
                self._tried.add(n)
                return angle
        return None

    def _is_free(self, place: Point, points: Sequence[Point]) -> bool:
        """Return whether a body has room at `place`, which the scan shows: nothing stands before it."""
        far_m = hypot(*place)
        if not 0.0 < far_m <= SEEN_M:
            return False
        c, s = place[0] / far_m, place[1] / far_m
        for x, y in points:
            along, across = c * x + s * y, abs(c * y - s * x)
            if hypot(x - place[0], y - place[1]) < self._clear_m or (0.0 < along < far_m and across < BESIDE_M):
                return False
        return True
