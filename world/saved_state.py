"""Saved state of a world, which outlives its process; `checkpoint.py` keeps it on disk."""

from __future__ import annotations

from msgspec import Struct

from lfa.protocol.geometry import Pose2D
from lfa.world.description.scenario import Obstacle


class Remembered(Struct, frozen=True):
    """Saved state of one robot at rest: the pose of its body, and its odometry."""

    id: int
    pose: Pose2D
    pose_odom: Pose2D
    odometer_m: float


class Memory(Struct, frozen=True):
    """Saved state of a world."""

    step: int
    """Index of the next point of the time grid."""
    robots: tuple[Remembered, ...]
    things: dict[int, Pose2D]
    """Poses in `map` of obstacles that are not fixed, by their index in the scenario."""
    added: tuple[Obstacle, ...] = ()
    """Obstacles set down during the run: a next incarnation has them in its scenario (`checkpoint.resumed`)."""
