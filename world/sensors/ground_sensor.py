"""Ground profile sensor: heights of the floor ahead of all robots, along three lines each, in one batch call.

The lines run in the direction of travel through the left wheel, the centre and the right wheel. A height is relative
to the ground under the robot (the mean of its wheels; it is taken to stand level). There is no occlusion: the sensor
looks straight down, as if on a boom.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lfa.protocol.geometry import Pose2D
from lfa.world.description.scenario import Scenario
from lfa.world.description.terrain import patches_of
from lfa.world.physics.wheel_contact import WHEEL_SIDE

Floats = npt.NDArray[np.float64]


class Profiler:
    """Downward-looking sensors of all robots of one scenario."""

    def __init__(self, scenario: Scenario) -> None:
        spec, side_m = scenario.world.ground, WHEEL_SIDE * scenario.mission.radius_m
        self._depth_m = spec.depth_m
        self.offsets_m = (side_m, 0.0, -side_m)
        count = round((spec.reach_m - spec.first_m) / spec.increment_m) + 1
        ahead = spec.first_m + spec.increment_m * np.arange(count)
        self._ahead = np.tile(ahead, 3)
        self._beside = np.repeat(np.array(self.offsets_m), count)
        self._shape = (3, count)
        self._reach_m = float(np.hypot(ahead[-1], side_m))
        self._patches = patches_of(scenario.world)
        self.flat = not self._patches
        """True for a world without terrain: its robots get no ground profiles, which saves 20 messages a second."""
        rows = [(p.x, p.y, p.reach_m, p.radius_m, p.half_x_m, p.half_y_m, p.c, p.s) for p in self._patches]
        self._rows = np.array(rows, dtype=float).reshape(-1, 8)

    def profile(self, robots: Sequence[Pose2D], standing_m: Sequence[float]) -> Floats:
        """Return the exact heights [m], shape (n, 3, points); a floor deeper than the sensor's range is -inf.

        `standing_m` is the height [m] of the ground under each robot.
        """
        heights = np.zeros((len(robots), self._ahead.size))
        if self._patches:
            poses = np.array([(pose.x, pose.y, pose.theta) for pose in robots])
            self._sink(heights, poses)
            heights -= np.array(standing_m)[:, None]
            heights[heights < -self._depth_m] = -np.inf
        return heights.reshape(len(robots), *self._shape)

    def _sink(self, heights: Floats, poses: Floats) -> None:
        """Write the floor's absolute height at each point of the robots near a patch into `heights`."""
        rows = self._rows
        away = np.hypot(rows[:, 0] - poses[:, 0:1], rows[:, 1] - poses[:, 1:2])
        robots, patches = np.nonzero(away <= self._reach_m + rows[:, 2])
        # Patches are sorted by precedence, so the first is written last.
        for n, index in sorted(zip(robots.tolist(), patches.tolist(), strict=True), key=lambda pair: -pair[1]):
            x, y, _, radius_m, half_x, half_y, pc, ps = rows[index]
            c, s = np.cos(poses[n, 2]), np.sin(poses[n, 2])
            dx = poses[n, 0] - x + c * self._ahead - s * self._beside
            dy = poses[n, 1] - y + s * self._ahead + c * self._beside
            if radius_m > 0.0:
                inside = dx * dx + dy * dy <= radius_m * radius_m
            else:
                inside = (np.abs(pc * dx + ps * dy) <= half_x) & (np.abs(pc * dy - ps * dx) <= half_y)
            heights[n, inside] = self._patches[index].height_m
