"""What the page's server asks of an engine: a team in virtual time, a running fleet, or a recording."""

from __future__ import annotations

from math import cos, hypot, pi, sin
from typing import Any, Protocol

from lfa.deploy.web.picture import COLUMNS, Picture
from lfa.world.description.scenario import Obstacle, Scenario
from lfa.world.description.terrain import patches_of

CORNERS = 24


class Engine(Protocol):
    """Source of pictures that takes orders."""

    @property
    def pictures(self) -> list[Picture]:
        """One picture for each team that the page shows, at most two."""

    @property
    def number(self) -> int:
        """Number of the present run; the page begins anew when it changes."""

    def scene(self) -> dict[str, Any]:
        """Return what does not change during the run."""

    def state(self) -> dict[str, Any]:
        """Return the state of the controls."""

    def advance(self) -> None:
        """Take in what has come since the last call."""

    def obey(self, order: dict[str, Any]) -> dict[str, Any]:
        """Carry out an order of the page and return the answer. Raises Refused."""

    def close(self) -> None:
        """Release what the engine holds."""


def ground_of(scenario: Scenario | None, label: str = "") -> dict[str, Any]:
    """Return walls, obstacles, terrain, route and robots of a drawn scenario as plain lists, in metres in `map`."""
    if scenario is None:
        return {"label": label, "walls": [], "obstacles": [], "terrain": [], "route": [], "columns": COLUMNS}
    mission, world = scenario.mission, scenario.world
    explores = mission.leading.motion == "explore"
    return {
        "label": label,
        "walls": [list(wall) for wall in world.walls_m],
        "obstacles": [_shape(obstacle) for obstacle in world.obstacles],
        "terrain": [_patch(patch) for patch in patches_of(world)],
        "route": [] if explores else [list(point) for point in mission.leading.route_m],
        "goal": list(mission.goal_m),
        "robots": list(mission.robots),
        "radius": mission.radius_m,
        "gap": mission.formation.separation_m,
        "limit": scenario.time_limit_s,
        "columns": COLUMNS,
    }


def _shape(obstacle: Obstacle) -> dict[str, Any]:
    """Return an obstacle: its centre, and its outline relative to it."""
    radius = obstacle.radius_m or 0.0
    circle = [(radius * cos(2.0 * pi * n / CORNERS), radius * sin(2.0 * pi * n / CORNERS)) for n in range(CORNERS)]
    return {"at": list(obstacle.center_m), "outline": [list(corner) for corner in obstacle.corners_m or circle]}


def _patch(patch: Any) -> dict[str, Any]:
    """Return a terrain patch: its outline in `map`, and whether it rises."""
    a, b, r = patch.half_x_m, patch.half_y_m, patch.radius_m
    circle = [(r * cos(2.0 * pi * n / CORNERS), r * sin(2.0 * pi * n / CORNERS)) for n in range(CORNERS)]
    corners = circle if r > 0.0 else [(a, -b), (a, b), (-a, b), (-a, -b)]
    laid = [[patch.x + patch.c * u - patch.s * v, patch.y + patch.s * u + patch.c * v] for u, v in corners]
    return {"outline": laid, "rises": patch.height_m > 0.0}


def robot_under(picture: Picture, robots: tuple[int, ...], x: float, y: float, apart_m: float) -> int | None:
    """Return a robot closer than `apart_m` to a place [m], None if there is none."""
    for robot in robots:
        at = picture.where(robot)
        if at is not None and hypot(at[0] - x, at[1] - y) < apart_m:
            return robot
    return None
