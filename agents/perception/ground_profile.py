"""Features of one floor profile: potholes, bumps and ditches, and which of them the wheels can cross.

Lengths in m; heights as in `GroundProfile`, relative to the floor that the robot stands on. `ground_map.py` keeps the
features of many profiles.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, cos, inf, isnan, sin
from typing import Literal

from msgspec import Struct

from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.robot import GroundProfile
from lfa.protocol.mission import Limits

GroundKind = Literal["pothole", "bump", "ditch"]

FLAT_M = 0.004
"""Height [m] relative to the floor around below which a reading is noise, and no wheel is affected."""
STRAIGHT_M = 0.08
"""Straightness [m] of the near edge over all three lines below which a hole is a ditch."""


class GroundFeature(Struct, frozen=True, gc=False):
    """One feature of the floor ahead, as far as seen."""

    kind: GroundKind
    near_m: float
    """Distance [m] to the near edge."""
    width_m: float
    """Width [m] along the direction of travel; inf when the far edge is out of sight."""
    size_m: float
    """Depth [m] of a hole or height [m] of a bump."""

    def crossable(self, limits: Limits) -> bool:
        """Return whether the wheels bridge the gap or climb the step; a bump without a visible end is not crossable."""
        if self.kind == "bump":
            return self.width_m < inf and self.size_m <= limits.climb_step_m
        return self.width_m <= limits.bridge_gap_m or self.size_m <= limits.climb_step_m


def readings_of(profile: GroundProfile, line: int, feature: GroundFeature, pose_map: Pose2D) -> list[Point]:
    """Return the feature's readings on `line`, in `map`."""
    last_m = profile.first_m + (len(profile.heights_m[line]) - 1) * profile.increment_m
    x, readings = feature.near_m, []
    while x <= min(feature.near_m + feature.width_m, last_m) + 1e-9:
        readings.append(at(pose_map, x, profile.offsets_m[line]))
        x += profile.increment_m
    return readings


def at(pose_map: Pose2D, x: float, y: float) -> Point:
    """Return the point (x, y) of `base_link` in `map`."""
    c, s = cos(pose_map.theta), sin(pose_map.theta)
    return pose_map.x + c * x - s * y, pose_map.y + s * x + c * y


def runs(profile: GroundProfile, line: int) -> list[GroundFeature]:
    """Return the runs of readings off the floor on one line; a missing reading neither begins nor ends one.

    A run's size is its median reading: the largest one would be dominated by noise.
    """
    heights, features = profile.heights_m[line], []
    start, sign = 0, 0.0
    run: list[float] = []
    for n, height in enumerate((*heights, 0.0)):
        missing = isnan(height)
        off = 0.0 if missing or abs(height) < FLAT_M else copysign(1.0, height)
        if run and off != sign and not missing:
            width = inf if n == len(heights) else (n - start) * profile.increment_m
            near_m, size_m = profile.first_m + start * profile.increment_m, sorted(run)[len(run) // 2]
            features.append(GroundFeature("bump" if sign > 0.0 else "pothole", near_m, width, size_m))
            run = []
        if off != 0.0:
            if not run:
                start, sign = n, off
            run.append(abs(height))
    return features


def is_ditch(features: Sequence[GroundFeature], lines: int) -> bool:
    """Return whether there is a hole on every line, with a straight near edge."""
    edges = [feature.near_m for feature in features if feature.kind == "pothole"]
    if len(edges) != lines or lines < 3:
        return False
    return abs(edges[0] - 2.0 * edges[1] + edges[2]) < STRAIGHT_M


def bridged_lines(features: Sequence[tuple[int, GroundFeature]], limits: Limits) -> set[int]:
    """Return the lines with a gap that wheels bridge and that a neighbouring line shows too, unlike a round hole's
    rim.
    """
    narrow = {line for line, f in features if f.kind == "pothole" and f.width_m <= limits.bridge_gap_m}
    return {line for line in narrow if line - 1 in narrow or line + 1 in narrow}
