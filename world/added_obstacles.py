"""Obstacles that an operator's order sets down during a run: which may stand where they are wanted, their numbers."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from lfa.protocol.geometry import Pose2D
from lfa.world.description.scenario import PLACE_M_MAX, RADIUS_M_MAX, RADIUS_M_MIN, Obstacle, Scenario

ADDED_MAX = 200
"""Largest number of obstacles set down during a run."""


class ObstacleOrder(Struct, frozen=True):
    """Arguments of an operator's order to set down a round obstacle."""

    x: Annotated[float, Meta(ge=-PLACE_M_MAX, le=PLACE_M_MAX)]
    y: Annotated[float, Meta(ge=-PLACE_M_MAX, le=PLACE_M_MAX)]
    radius_m: Annotated[float, Meta(ge=RADIUS_M_MIN, le=RADIUS_M_MAX)]


Taken = tuple[dict[str, Any], Obstacle | None]
"""What to tell about an order, and the obstacle that it adds, if it adds one."""


class AddedObstacles:
    """Obstacles set down in the world of a drawn scenario; `inherited` ones stand at the end of its list already."""

    def __init__(self, scenario: Scenario, inherited: tuple[Obstacle, ...]) -> None:
        self._mission = scenario.mission
        self._first = len(scenario.world.obstacles)
        self._inherited = inherited
        self._added: list[Obstacle] = []

    @property
    def all(self) -> tuple[Obstacle, ...]:
        """Obstacles set down since the first incarnation of the world."""
        return (*self._inherited, *self._added)

    @property
    def new(self) -> tuple[Obstacle, ...]:
        """Obstacles set down since this incarnation began; the scenario's list has none of them."""
        return tuple(self._added)

    def take(
        self, arguments: dict[str, Any], robots: Sequence[Pose2D]
    ) -> tuple[dict[str, Any], Obstacle | None] | None:
        """Return what to tell about an order, and the obstacle to add, or None where a robot stands; its index is
        told too. `robots` are the poses of the mission's robots. Return None for an order that is none.
        """
        try:
            wanted = msgspec.convert(arguments, ObstacleOrder)
        except msgspec.ValidationError:
            return None
        place: dict[str, Any] = {"x": wanted.x, "y": wanted.y, "radius_m": wanted.radius_m}
        apart_m = wanted.radius_m + self._mission.radius_m
        placed = zip(self._mission.robots, robots, strict=True)
        under = next((robot for robot, pose in placed if hypot(pose.x - wanted.x, pose.y - wanted.y) < apart_m), None)
        if under is not None or len(self._added) >= ADDED_MAX:
            why = f"there are {ADDED_MAX} already" if under is None else f"robot {under} stands there"
            return {**place, "refused": why}, None
        obstacle = Obstacle((wanted.x, wanted.y), wanted.radius_m)
        self._added.append(obstacle)
        return {**place, "index": self._first + len(self._added) - 1}, obstacle
