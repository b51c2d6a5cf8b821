"""One obstacle as the avoidance rules see it: class, place and extent, in `base_link`."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

Class = Literal["stationary", "moving", "wall", "pothole", "bump", "ditch"]


class BlockingObstacle(Struct, frozen=True):
    """What bars the way."""

    kind: Class = "stationary"
    width_m: float = 0.0
    """As far as seen; inf when its end is out of sight."""
