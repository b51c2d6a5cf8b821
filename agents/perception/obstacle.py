"""Obstacle that blocks the way, as the avoidance rules use it: class and width."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

Class = Literal["stationary", "moving", "wall", "pothole", "bump", "ditch"]
ON_THE_MAP: tuple[Class, ...] = ("wall", "stationary", "moving")
"""Classes that the laser scanner shows, so that a planner on a map leads round them."""


class BlockingObstacle(Struct, frozen=True):
    """Obstacle that blocks the way."""

    kind: Class = "stationary"
    width_m: float = 0.0
    """Visible width [m]; inf when its end is out of sight."""
