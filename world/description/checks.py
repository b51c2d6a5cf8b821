"""Range and consistency checks of a scenario; each mistake names the key, the value and the valid range."""

from __future__ import annotations

import re
from collections.abc import Iterator
from difflib import get_close_matches
from math import hypot, isfinite, pi

from lfa.protocol.config_file.mistake import Mistake, Range, Rule, out_of_range, wrong
from lfa.protocol.geometry import TAU, convex
from lfa.protocol.messages.robot import NEAR_M_MAX
from lfa.protocol.mission_checks import footprint_mistakes
from lfa.protocol.names import robot_name
from lfa.world.description.scenario import SPEED_MPS_MAX, SPEED_MPS_MIN, Assert, Obstacle, Scenario
from lfa.world.description.terrain import feature_mistakes, features

ROBOTS_MAX = 1000
LENGTH_M_MIN = 0.001
BEAMS_MIN, BEAMS_MAX = 4, 4096
"""Bounds of the number of beams of a scanner; a robot without one has 0."""
SEEING_MOTIONS = ("reactive", "explore")
"""Motions of a leader that finds its way by what its scanner shows."""
PHYSICS_HZ_MIN, PHYSICS_HZ_MAX = 100.0, 1000.0


def _robots(scenario: Scenario) -> Iterator[Mistake]:
    robots, world = scenario.robots, scenario.world
    if len(robots) > ROBOTS_MAX:
        yield wrong("mission.robots", f"{len(robots)} ids", f"at most {ROBOTS_MAX} ids")
    for n, spare in enumerate(world.spares):
        if spare.id < 1 or robots.index(spare.id) != len(scenario.mission.robots) + n:
            yield wrong(f"world.spares[{n}].id", spare.id, "an id, 1 or higher, of no other robot")
    strange = [robot for robot in world.real_robots if robot not in robots]
    if strange:
        yield wrong("world.real_robots", strange, f"ids among {list(robots)}", "mission.robots")
    # E19: a real robot's gateway does not fail together with the witness.
    cold_start = scenario.mission.cold_start
    if world.real_robots and cold_start != "full_house":
        yield wrong("mission.cold_start", cold_start, "full_house with world.real_robots", "world.real_robots")


def _saved_from(scenario: Scenario) -> Iterator[Mistake]:
    """Require a name that can be part of a file's: the run folder is called after it."""
    if scenario.saved_from and not re.fullmatch(r"[\w-][\w.-]{0,63}", scenario.saved_from, re.ASCII):
        yield wrong("saved_from", scenario.saved_from, "up to 64 letters, digits, '-', '_' and '.'")


def _restarts(scenario: Scenario) -> Iterator[Mistake]:
    processes = ("router", "world", "robots", *map(robot_name, scenario.robots))
    for name, policy in scenario.restart.items():
        if name not in processes:
            close = get_close_matches(name, processes, n=1)
            hint = f"did you mean {close[0]!r}?" if close else f"must be of {', '.join(processes)}"
            yield Mistake(f"restart.{name}", f" = {policy}: no such process: {hint}")


def _walls(scenario: Scenario) -> Iterator[Mistake]:
    for n, wall in enumerate(scenario.world.walls_m):
        if hypot(wall[2] - wall[0], wall[3] - wall[1]) < LENGTH_M_MIN:
            yield wrong(f"world.walls_m[{n}]", list(wall), "two different ends x1, y1, x2, y2")


def _assertions(scenario: Scenario) -> Iterator[Mistake]:
    for bound in Assert.__struct_fields__:
        value = getattr(scenario.asserted, bound)
        if value is not None and value < 0:
            yield wrong(f"assert.{bound}", value, "0 or more: less can never hold, or always does")


def _footprint(scenario: Scenario) -> Iterator[Mistake]:
    """Find a body that is none, or another one than the robots are told of."""
    where, corners, told = "world.body.footprint_m", scenario.world.body.footprint_m, scenario.mission.footprint_m
    if not corners:
        return
    if told and told != corners:
        right = "that of mission.footprint_m, or left out"
        yield wrong(where, [list(corner) for corner in corners], right, "mission.footprint_m")
    else:
        yield from footprint_mistakes(where, corners, scenario.mission.radius_m)


def _mount(scenario: Scenario) -> Iterator[Mistake]:
    """Require a scanner on the robot: its beams begin inside of the body's circle."""
    mount, radius_m = scenario.world.lidar.mount, scenario.mission.radius_m
    if not (all(map(isfinite, mount)) and hypot(mount[0], mount[1]) <= radius_m and abs(mount[2]) <= TAU):
        right = f"x, y [m] within mission.radius_m = {radius_m:g} of the centre, and an angle [rad] of a turn at most"
        yield wrong("world.lidar.mount", list(mount), right, "mission.radius_m")


def _beams(scenario: Scenario) -> Iterator[Mistake]:
    """Require a scanner of enough beams, or none and a course on which nobody needs one."""
    world, motion, beams = scenario.world, scenario.mission.leading.motion, "world.lidar.beams"
    if world.lidar.fitted:
        if not BEAMS_MIN <= world.lidar.beams <= BEAMS_MAX:
            right = f"a number from {BEAMS_MIN} to {BEAMS_MAX}, or 0 for robots without a scanner"
            yield wrong(beams, world.lidar.beams, right)
        return
    blind = f"robots without a scanner ({beams} = 0)"
    if motion in SEEING_MOTIONS:
        yield wrong(
            "mission.leading.motion", motion, f"path_following, point_to_point or trajectory for {blind}", beams
        )
    if world.map is not None:
        yield wrong("world.map", world.map, f"left out for {blind}: they would drive into its walls", beams)
    for key, count in (("world.obstacles", len(world.obstacles)), ("world.walls_m", len(world.walls_m))):
        if count:
            yield wrong(key, f"{count} of them", f"left out for {blind}: they would drive into them", beams)


def _terrain(scenario: Scenario) -> Iterator[Mistake]:
    for key, feature in features(scenario.world):
        yield from feature_mistakes(f"world.{key}", feature)


def _ranges(scenario: Scenario) -> Iterator[Mistake]:
    world, radio = scenario.world, scenario.radio
    noise, vary, lidar, ground = world.noise, world.vary, world.lidar, world.ground
    return out_of_range((
        Range("time_limit_s", scenario.time_limit_s, 1.0, 1e6),
        Range("world.physics_hz", world.physics_hz, PHYSICS_HZ_MIN, PHYSICS_HZ_MAX),
        Range("world.body.mass_kg", world.body.mass_kg, 0.1, 1e4),
        Range("world.body.push_n", world.body.push_n, 0.1, 1e6),
        Range("world.body.wheel_radius_m", world.body.wheel_radius_m, 0.005, 1.0),
        Range("world.lidar.range_min_m", lidar.range_min_m, 0.0, min(lidar.range_max_m, NEAR_M_MAX)),
        Range("world.lidar.range_max_m", lidar.range_max_m, 0.1, 1e3),
        Range("world.lidar.fov_rad", lidar.fov_rad, 0.1, TAU),
        Range("world.lidar.rate_hz", lidar.rate_hz, 0.1, world.physics_hz, "world.physics_hz"),
        Range("world.ground.first_m", ground.first_m, 0.0, ground.reach_m, "world.ground.reach_m"),
        Range("world.ground.reach_m", ground.reach_m, 0.05, 10.0),
        Range("world.ground.increment_m", ground.increment_m, 0.01, 1.0),
        Range("world.ground.depth_m", ground.depth_m, 0.01, 10.0),
        Range("world.noise.localization_m", noise.localization_m, 0.0, 10.0),
        Range("world.noise.localization_rad", noise.localization_rad, 0.0, 3.0),
        Range("world.noise.localization_dropout", noise.localization_dropout, 0.0, 1.0),
        Range("world.noise.odometry", noise.odometry, 0.0, 1.0),
        Range("world.noise.range_m", noise.range_m, 0.0, 10.0),
        Range("world.noise.range_dropout", noise.range_dropout, 0.0, 1.0),
        Range("world.noise.range_outlier", noise.range_outlier, 0.0, 1.0),
        Range("world.noise.ground_m", noise.ground_m, 0.0, 1.0),
        Range("world.noise.ground_dropout", noise.ground_dropout, 0.0, 1.0),
        Range("world.noise.ground_outlier", noise.ground_outlier, 0.0, 1.0),
        Range("world.vary.obstacles_m", vary.obstacles_m, 0.0, 10.0),
        Range("world.vary.starts_m", vary.starts_m, 0.0, 10.0),
        Range("world.vary.starts_rad", vary.starts_rad, 0.0, pi),
        Range("radio.delay_s", radio.delay_s, 0.0, 10.0),
        Range("radio.jitter_s", radio.jitter_s, 0.0, 10.0),
        Range("radio.loss", radio.loss, 0.0, 1.0),
        Range("radio.loss_burst", radio.loss_burst, 1.0, 1e4),
        Range("radio.duplication", radio.duplication, 0.0, 1.0),
        Range("radio.duplication_lag_s", radio.duplication_lag_s, 0.0, 10.0),
        Range("radio.tail", radio.tail, 0.0, 1.0),
        Range("radio.tail_mean_s", radio.tail_mean_s, 1e-4, 10.0),
        Range("radio.reorder", radio.reorder, 0.0, 1.0),
        Range("radio.range_m", radio.range_m, 0.0, 1e4),
    ))  # fmt: skip


def _obstacles(scenario: Scenario) -> Iterator[Mistake]:
    for n, obstacle in enumerate(scenario.world.obstacles):
        yield from _shape(f"world.obstacles[{n}]", obstacle)
        yield from _motion(f"world.obstacles[{n}]", obstacle)


def _shape(where: str, obstacle: Obstacle) -> Iterator[Mistake]:
    """Require exactly one shape, of possible size."""
    radius_m, corners_m = obstacle.radius_m, obstacle.corners_m
    if (radius_m is None) == (corners_m is None):
        says = " = radius_m and corners_m: must be exactly one of the two"
        yield Mistake(where, says, (f"{where}.radius_m", f"{where}.corners_m"))
    if radius_m is not None and not 0.01 <= radius_m <= 100.0:
        yield wrong(f"{where}.radius_m", radius_m, "a number from 0.01 to 100")
    if corners_m is not None and not convex(corners_m):
        right = "at least three corners of a convex polygon, counter-clockwise"
        yield wrong(f"{where}.corners_m", [list(corner) for corner in corners_m], right)
    if obstacle.mass_kg is not None and not 0.01 <= obstacle.mass_kg <= 1e4:
        yield wrong(f"{where}.mass_kg", obstacle.mass_kg, "a number from 0.01 to 10000")


def _motion(where: str, obstacle: Obstacle) -> Iterator[Mistake]:
    """Require at most one kind of motion, of possible speed."""
    if not 0.0 <= obstacle.phase < 1.0:
        yield wrong(f"{where}.phase", obstacle.phase, "from 0 up to, not including, 1")
    ways = {"waypoints_m": obstacle.waypoints_m, "velocity_mps": obstacle.velocity_mps, "walk_m": obstacle.walk_m}
    given = [name for name, way in ways.items() if way not in ((), None)]
    keys = tuple(f"{where}.{name}" for name in ways)
    if len(given) > 1:
        yield Mistake(where, f" = {' and '.join(given)}: must be one way of moving", keys)
    elif given and obstacle.mass_kg is not None:
        yield wrong(f"{where}.mass_kg", obstacle.mass_kg, f"left out with {given[0]}", *keys)
    low, high = (0.0, 0.0) if given in ([], ["velocity_mps"]) else (SPEED_MPS_MIN, SPEED_MPS_MAX)
    if not low <= obstacle.speed_mps <= high:
        right = "above 0 with waypoints_m or walk_m, and 0 without"
        yield wrong(f"{where}.speed_mps", obstacle.speed_mps, right, *keys)
    if obstacle.waypoints_m and all(point == obstacle.center_m for point in obstacle.waypoints_m):
        right = "a place other than center_m"
        yield wrong(f"{where}.waypoints_m", list(obstacle.center_m), right, f"{where}.center_m")
    velocity = obstacle.velocity_mps
    if velocity is not None and not SPEED_MPS_MIN <= hypot(*velocity) <= SPEED_MPS_MAX:
        yield wrong(f"{where}.velocity_mps", list(velocity), "from 0.001 to 10 m/s")
    if obstacle.walk_m is not None and not obstacle.speed_mps <= obstacle.walk_m <= 1e3:
        right = "a number from speed_mps (the way of one second) to 1000"
        yield wrong(f"{where}.walk_m", obstacle.walk_m, right, f"{where}.speed_mps")


SCENARIO_RULES: tuple[Rule[Scenario], ...] = tuple(
    Rule(check)
    for check in (
        _saved_from,
        _robots,
        _beams,
        _ranges,
        _obstacles,
        _footprint,
        _mount,
        _terrain,
        _assertions,
        _restarts,
        _walls,
    )
)
