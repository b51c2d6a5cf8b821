"""Run-up of a polygon: before a gap that it meets aslant or beside the middle, it backs off and comes again.

A round body at a gap has only to move aside. A polygon cannot turn between two walls, and needs some way to come in
squarely.
"""

from __future__ import annotations

from lfa.protocol.geometry import Pose2D, Twist, distance

RUN_UP_M = 0.5
"""Length [m] of a run-up."""
PLACE_M = 0.7
"""Distance [m] within which the next gap is the same one."""
TRIES_MAX = 3
"""Number of run-ups before one gap, after which another way is looked for."""


class RunUp:
    """Run-ups of one robot."""

    def __init__(self) -> None:
        self._met: Pose2D | None = None
        self._tries = 0
        self._under_way = False

    def step(self, pose: Pose2D, back: Twist, *, blocked: bool) -> Twist | None:
        """Return `back`, the twist that backs off, during a run-up; None while there is none. `blocked`: no arc leads
        on from `pose`.
        """
        if self._met is None or distance(self._met, pose) > PLACE_M:
            self._met, self._tries, self._under_way = None, 0, False
        if self._under_way and self._met is not None and distance(self._met, pose) >= RUN_UP_M:
            self._under_way = False
        elif blocked and not self._under_way and self._tries < TRIES_MAX:
            self._met, self._under_way = pose, True
            self._tries += 1
        if back.linear_x == 0.0:
            self._under_way = False
        return back if self._under_way else None
