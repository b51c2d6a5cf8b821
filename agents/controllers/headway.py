"""Constant time headway: the slot falls back by `headway_s` of its own speed.

Tolerates delay without a buffer (|G| <= 1 when the headway is at least the latency, control.md 5.1), at the price of a
gap that grows with speed.
"""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import replace

from lfa.agents.config import Gains
from lfa.agents.following.controller import Law, Reference
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.mission import Limits


class HeadwayParameters(Struct, frozen=True, forbid_unknown_fields=True):
    headway_s: float = 0.3
    """Time [s] of its own speed by which the slot falls back."""


class Headway:
    Parameters = HeadwayParameters

    def __init__(self, gains: Gains, limits: Limits, parameters: HeadwayParameters) -> None:
        self._headway_s = parameters.headway_s
        # K (r - h r' - p) takes K h from the feed-forward: with dead reckoning a + K tau becomes 1 - K (h - tau).
        self._law = Law(gains, limits)

    def reset(self, own_pose: Pose2D, own_twist: Twist) -> None:
        self._law.reset(own_pose, own_twist)

    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
        h = self._headway_s
        fallen_back = replace(reference, x=reference.x - h * reference.vx, y=reference.y - h * reference.vy)
        return self._law.step(fallen_back, own_pose, own_twist, dt)
