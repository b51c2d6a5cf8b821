"""`lfa bench lidar`: rays per second of the batch lidar on one core, beside a plain loop over pymunk's ray query.

The world is the one in which peer projects were measured: 20 obstacles, half of them round,
and outer walls; 10 m of range over 360 degrees, 360 beams.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from math import cos, sin
from random import Random
from time import process_time
from typing import Any

import pymunk

from lfa.protocol.geometry import TAU, Pose2D
from lfa.protocol.mission import Mission
from lfa.world.description.load import Lidar, Obstacle, Scenario, WorldSpec
from lfa.world.sensors.lidar import ANGLE_MIN, Scanner

TEAMS = (4, 20, 100)
BEAMS = 360
SIDE_M = 20.0
RAYS_PER_S_MIN = 1e6
"""Minimum number of rays per second on one core."""
MEASURE_S = 0.3
TRIES = 3


def rows() -> list[dict[str, Any]]:
    """Return one row per team size: `value` [rays/s], `ratio` to the naive loop measured in the same run."""
    return [_row(robots) for robots in TEAMS]


def run(as_json: bool) -> int:
    """Print the rows as a table or as JSON; return 0 if all reach their bars, else 1."""
    measured = rows()
    if as_json:
        print(json.dumps({"rows": measured}))
    else:
        print(f"{'':<22}{'rays/s':>14}{'bar':>14}{'naive x':>10}")
        for row in measured:
            mark = "ok" if row["ok"] else "BELOW THE BAR"
            print(f"{row['name']:<22}{row['value']:>14,.0f}{row['bar']:>14,.0f}{row['ratio']:>10.1f}  {mark}")
    return 0 if all(row["ok"] for row in measured) else 1


def _row(robots: int) -> dict[str, Any]:
    scenario = _scenario()
    poses = _poses(robots)
    scanner = Scanner(scenario)
    batch = _rays_per_s(robots, lambda: scanner.scan(poses, {}))
    space, circles = _space(scenario, poses)
    naive = _rays_per_s(robots, lambda: _naive_scan(space, circles, poses, scenario.world.lidar))
    return {
        "name": f"lidar {robots} robots",
        "value": round(batch),
        "unit": "rays/s",
        "bar": RAYS_PER_S_MIN,
        "ratio": round(batch / naive, 1),
        "ok": batch >= RAYS_PER_S_MIN,
    }


def _rays_per_s(robots: int, scan: Callable[[], object]) -> float:
    """Return the best rate [rays/s] of `TRIES`, in processor time of this process."""
    scan()
    best = 0.0
    for _ in range(TRIES):
        scans, since = 0, process_time()
        while process_time() - since < MEASURE_S:
            scan()
            scans += 1
        best = max(best, scans * robots * BEAMS / (process_time() - since))
    return best


def _scenario() -> Scenario:
    chance = Random("lidar bench")
    box = ((-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3))
    places = [(chance.uniform(1.0, SIDE_M - 1.0), chance.uniform(1.0, SIDE_M - 1.0)) for _ in range(20)]
    round_ones = [Obstacle(center_m=place, radius_m=chance.uniform(0.2, 0.5)) for place in places[:10]]
    boxes = [Obstacle(center_m=place, corners_m=box) for place in places[10:]]
    corners = ((0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M), (0.0, 0.0))
    walls = tuple((*corners[n], *corners[n + 1]) for n in range(4))
    lidar = Lidar(beams=BEAMS, range_max_m=10.0)
    return Scenario("bench", Mission(), 1.0, WorldSpec(walls_m=walls, obstacles=(*round_ones, *boxes), lidar=lidar))


def _poses(robots: int) -> list[Pose2D]:
    chance = Random(f"lidar bench {robots}")
    return [
        Pose2D(chance.uniform(0.5, SIDE_M - 0.5), chance.uniform(0.5, SIDE_M - 0.5), chance.uniform(-3.0, 3.0))
        for _ in range(robots)
    ]


def _space(scenario: Scenario, poses: list[Pose2D]) -> tuple[pymunk.Space, list[pymunk.Shape]]:
    """Return the same world in pymunk, and the robots' circles, which their own scans must exclude."""
    space = pymunk.Space()
    ground = space.static_body
    for x1, y1, x2, y2 in scenario.world.walls_m:
        space.add(pymunk.Segment(ground, (x1, y1), (x2, y2), 0.0))
    for obstacle in scenario.world.obstacles:
        (x, y), corners_m = obstacle.center_m, obstacle.corners_m
        if obstacle.radius_m is not None:
            space.add(pymunk.Circle(ground, obstacle.radius_m, (x, y)))
        elif corners_m is not None:
            space.add(pymunk.Poly(ground, [(x + cx, y + cy) for cx, cy in corners_m]))
    circles: list[pymunk.Shape] = []
    for n, pose in enumerate(poses):
        circle = pymunk.Circle(ground, scenario.mission.radius_m, (pose.x, pose.y))
        circle.filter = pymunk.ShapeFilter(group=n + 1)
        circles.append(circle)
        space.add(circle)
    return space, circles


def _naive_scan(space: pymunk.Space, circles: list[pymunk.Shape], poses: list[Pose2D], lidar: Lidar) -> list[float]:
    """Return the ranges [m] of all beams with one query per beam, the simplest implementation."""
    ranges = []
    for pose, circle in zip(poses, circles, strict=True):
        for beam in range(lidar.beams):
            angle = pose.theta + ANGLE_MIN + beam * TAU / lidar.beams
            end = pose.x + lidar.range_max_m * cos(angle), pose.y + lidar.range_max_m * sin(angle)
            hit = space.segment_query_first((pose.x, pose.y), end, 0.0, circle.filter)
            ranges.append(hit.alpha * lidar.range_max_m if hit is not None else float("inf"))
    return ranges
