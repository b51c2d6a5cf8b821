"""Messages of the simulator only: ground truth and clock."""

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
    """A body that moves, by its place in the scenario's list."""

    index: int
    x: float
    y: float


class Truth(Struct, frozen=True, array_like=True, tag="truth"):
    """All bodies at one moment `time_s` of the world's own time (0 at its start)."""

    header: Header
    time_s: float
    robots: tuple[TrueRobot, ...]
    obstacles: tuple[TrueObstacle, ...] = ()


class Clock(Struct, frozen=True, array_like=True, tag="clock"):
    header: Header
    time_s: float
