"""Messages that only the simulator publishes: ground truth and clock."""

from __future__ import annotations

from msgspec import Struct

from lfa.protocol.messages.header import Header


class TrueRobot(Struct, frozen=True, array_like=True, gc=False):
    id: int
    x: float
    y: float
    theta: float
    linear_x: float
    angular_z: float


class TrueObstacle(Struct, frozen=True, array_like=True, gc=False):
    """Moving obstacle; `index` is its position in the scenario's list."""

    index: int
    x: float
    y: float


class Truth(Struct, frozen=True, array_like=True, tag="truth"):
    """Ground truth of all bodies at `time_s` of the world's own time (0 at its start)."""

    header: Header
    time_s: float
    robots: tuple[TrueRobot, ...]
    obstacles: tuple[TrueObstacle, ...] = ()


class Clock(Struct, frozen=True, array_like=True, tag="clock"):
    header: Header
    time_s: float
