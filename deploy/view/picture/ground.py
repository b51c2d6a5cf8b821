"""The ground of a picture: what stands in a drawn scenario, as plain lists. Pure."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

from lfa.deploy.view.picture.picture import COLUMNS
from lfa.protocol.mission import Mission
from lfa.world.description.scenario import Obstacle, Scenario
from lfa.world.description.terrain import patches_of

CORNERS = 24


def ground_of(scenario: Scenario, label: str = "") -> dict[str, Any]:
    """Return walls, obstacles, terrain, route and robots of a drawn scenario as plain lists, in metres in `map`."""
    world = scenario.world
    return {
        **ground_of_mission(scenario.mission, label),
        "walls": [list(wall) for wall in world.walls_m],
        "obstacles": [_shape(obstacle) for obstacle in world.obstacles],
        "terrain": [_patch(patch) for patch in patches_of(world)],
    }


def ground_of_mission(mission: Mission, label: str = "") -> dict[str, Any]:
    """Return the same of a mission alone, for a fleet whose world is not known."""
    explores = mission.leading.motion == "explore"
    return {
        "label": label,
        "walls": [],
        "obstacles": [],
        "terrain": [],
        "route": [] if explores else [list(point) for point in mission.leading.route_m],
        "goal": list(mission.goal_m),
        "robots": list(mission.robots),
        "radius": mission.radius_m,
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
