"""Moving obstacles that other robots reported, extrapolated for a bounded time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import hypot

from lfa.agents.perception.obstacle_tracker import Feature
from lfa.protocol.geometry import Point, Pose2D
from lfa.protocol.messages.team import ObstacleNote

REPORTERS_MAX = 512
"""Maximum number of robots whose reports are kept."""
REMOTE_TRACK_S, PARTIAL_TRACK_S = 3.0, 6.0
"""A moving obstacle reported by another robot is extrapolated this long [s] after the last report; it may be occluded.
The longer time holds where this robot's own scan shows something whose motion is not known yet."""
SAME_M = 0.5
"""A reported obstacle nearer than this [m] to a robot, or to a known obstacle, is taken for that one."""


class SharedObstacles:
    """The last report of each robot, merged into what this robot's own scan shows."""

    def __init__(self, robots: Callable[[float], Iterable[Pose2D | None]]) -> None:
        """`robots(now)` returns the poses in `map` of all robots that are heard; None for a stale one."""
        self._robots = robots
        self._reports: dict[int, tuple[ObstacleNote, float]] = {}

    def update(self, robot: int, note: ObstacleNote, at: float) -> None:
        """Keep `note`, the report of `robot` received at `at` [s]; only moving obstacles count."""
        if note.kind == "moving" and (robot in self._reports or len(self._reports) < REPORTERS_MAX):
            self._reports[robot] = (note, at)

    def moving(
        self,
        seen: list[Feature],
        here: Pose2D,
        now: float,
        seen_near: Callable[[float, float, float], bool] = lambda x, y, within_m: False,
        seen_free: Callable[[Point], bool] = lambda place: False,
    ) -> list[Feature]:
        """Return `seen` and the reported obstacles, extrapolated to `now` [s], less those that are robots, and those
        that turned on the way: this robot looks through where they would be.

        `seen_near(x, y, within_m)` returns whether this robot's scan shows anything near (x, y) in `map`, and
        `seen_free(place)` whether it looks through a place.
        """
        if not self._reports:
            return seen
        known = list(seen)
        for note, at in self._reports.values():
            vx, vy = note.twist_map
            x, y = note.x + vx * (now - at), note.y + vy * (now - at)
            if now - at <= REMOTE_TRACK_S or (now - at <= PARTIAL_TRACK_S and seen_near(x, y, SAME_M)):
                robots = (here, *self._robots(now))
                ours = any(p is not None and hypot(x - p.x, y - p.y) < SAME_M for p in robots)
                if not ours and all(hypot(x - f.x, y - f.y) > SAME_M for f in known) and not seen_free((x, y)):
                    known.append(Feature("moving", x, y, note.radius_m, vx, vy))
        return known
