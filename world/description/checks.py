"""Range and consistency checks of a scenario; each error names the key, the value and the valid range."""

from __future__ import annotations

from math import atan2, hypot, pi

from lfa.protocol.errors import Refused
from lfa.protocol.geometry import TAU
from lfa.protocol.mission_checks import check_mission
from lfa.protocol.names import robot_name
from lfa.world.description.scenario import SPEED_MPS_MAX, SPEED_MPS_MIN, Assert, Obstacle, Point, Scenario
from lfa.world.description.terrain import check_feature, features

ROBOTS_MAX = 500
LENGTH_M_MIN = 0.001
PHYSICS_HZ_MIN, PHYSICS_HZ_MAX = 100.0, 1000.0


def check_scenario(scenario: Scenario) -> Scenario:
    """Return `scenario` unchanged. Raises `Refused` with the first field from which no world can be built."""
    robots = scenario.mission.robots
    _require(len(robots) <= ROBOTS_MAX, "mission.robots", f"{len(robots)} ids", f"at most {ROBOTS_MAX} ids")
    check_mission(scenario.mission)
    for where, value, low, high in _ranges(scenario):
        _require(low <= value <= high, where, value, f"a number from {low:g} to {high:g}")
    for index, obstacle in enumerate(scenario.world.obstacles):
        _check_obstacle(f"world.obstacles[{index}]", obstacle)
    for key, feature in features(scenario.world):
        check_feature(f"world.{key}", feature)
    for bound in Assert.__struct_fields__:
        value = getattr(scenario.asserted, bound)
        _require(
            value is None or value >= 0, f"assert.{bound}", value, "0 or more: less can never hold, or always does"
        )
    processes = ("router", "world", "robots", *(robot_name(robot) for robot in robots))
    strange = [robot for robot in scenario.world.real_robots if robot not in robots]
    _require(not strange, "world.real_robots", strange, f"ids among {list(robots)}")
    # E19: a real robot's gateway does not fail together with the witness.
    waits = not scenario.world.real_robots or scenario.mission.cold_start == "full_house"
    _require(waits, "mission.cold_start", scenario.mission.cold_start, "full_house with world.real_robots")
    stranger = next((name for name in scenario.restart if name not in processes), None)
    _require(stranger is None, "restart", stranger, f"of {', '.join(processes)}")
    for index, wall in enumerate(scenario.world.walls_m):
        where = f"world.walls_m[{index}]"
        long_enough = hypot(wall[2] - wall[0], wall[3] - wall[1]) >= LENGTH_M_MIN
        _require(long_enough, where, list(wall), "two different ends x1, y1, x2, y2")
    return scenario


def _ranges(scenario: Scenario) -> list[tuple[str, float, float, float]]:
    world, radio = scenario.world, scenario.radio
    noise, vary, lidar, ground = world.noise, world.vary, world.lidar, world.ground
    return [
        ("time_limit_s", scenario.time_limit_s, 1.0, 1e6),
        ("world.physics_hz", world.physics_hz, PHYSICS_HZ_MIN, PHYSICS_HZ_MAX),
        ("world.body.mass_kg", world.body.mass_kg, 0.1, 1e4),
        ("world.body.push_n", world.body.push_n, 0.1, 1e6),
        ("world.body.wheel_radius_m", world.body.wheel_radius_m, 0.005, 1.0),
        ("world.lidar.beams", lidar.beams, 4, 4096),
        ("world.lidar.range_min_m", lidar.range_min_m, 0.0, lidar.range_max_m),
        ("world.lidar.range_max_m", lidar.range_max_m, 0.1, 1e3),
        ("world.lidar.rate_hz", lidar.rate_hz, 0.1, world.physics_hz),
        ("world.ground.first_m", ground.first_m, 0.0, ground.reach_m),
        ("world.ground.reach_m", ground.reach_m, 0.05, 10.0),
        ("world.ground.increment_m", ground.increment_m, 0.01, 1.0),
        ("world.ground.depth_m", ground.depth_m, 0.01, 10.0),
        ("world.noise.localization_m", noise.localization_m, 0.0, 10.0),
        ("world.noise.localization_rad", noise.localization_rad, 0.0, 3.0),
        ("world.noise.localization_dropout", noise.localization_dropout, 0.0, 1.0),
        ("world.noise.odometry", noise.odometry, 0.0, 1.0),
        ("world.noise.range_m", noise.range_m, 0.0, 10.0),
        ("world.noise.range_dropout", noise.range_dropout, 0.0, 1.0),
        ("world.noise.range_outlier", noise.range_outlier, 0.0, 1.0),
        ("world.noise.ground_m", noise.ground_m, 0.0, 1.0),
        ("world.noise.ground_dropout", noise.ground_dropout, 0.0, 1.0),
        ("world.noise.ground_outlier", noise.ground_outlier, 0.0, 1.0),
        ("world.vary.obstacles_m", vary.obstacles_m, 0.0, 10.0),
        ("world.vary.starts_m", vary.starts_m, 0.0, 10.0),
        ("world.vary.starts_rad", vary.starts_rad, 0.0, pi),
        ("radio.delay_s", radio.delay_s, 0.0, 10.0),
        ("radio.jitter_s", radio.jitter_s, 0.0, 10.0),
        ("radio.loss", radio.loss, 0.0, 1.0),
        ("radio.loss_burst", radio.loss_burst, 1.0, 1e4),
        ("radio.duplication", radio.duplication, 0.0, 1.0),
    ]


def _check_obstacle(where: str, obstacle: Obstacle) -> None:
    """Require one shape and at most one kind of motion. Raises Refused."""
    radius_m, corners_m, mass_kg = obstacle.radius_m, obstacle.corners_m, obstacle.mass_kg
    shaped = (radius_m is None) != (corners_m is None)
    _require(shaped, where, "radius_m and corners_m", "exactly one of the two")
    if radius_m is not None:
        _require(0.01 <= radius_m <= 100.0, f"{where}.radius_m", radius_m, "a number from 0.01 to 100")
    if corners_m is not None:
        right = "at least three corners of a convex polygon, counter-clockwise"
        _require(_convex(corners_m), f"{where}.corners_m", [list(corner) for corner in corners_m], right)
    if mass_kg is not None:
        _require(0.01 <= mass_kg <= 1e4, f"{where}.mass_kg", mass_kg, "a number from 0.01 to 10000")
    _require(0.0 <= obstacle.phase < 1.0, f"{where}.phase", obstacle.phase, "from 0 up to, not including, 1")
    ways = (("waypoints_m", obstacle.waypoints_m), ("velocity_mps", obstacle.velocity_mps), ("walk_m", obstacle.walk_m))
    given = [name for name, way in ways if way not in ((), None)]
    _require(len(given) <= 1, where, " and ".join(given), "one way of moving")
    _require(not (given and mass_kg is not None), f"{where}.mass_kg", mass_kg, f"left out with {''.join(given)}")
    paced = given not in ([], ["velocity_mps"])
    low, high = (SPEED_MPS_MIN, SPEED_MPS_MAX) if paced else (0.0, 0.0)
    right = "above 0 with waypoints_m or walk_m, and 0 without"
    _require(low <= obstacle.speed_mps <= high, f"{where}.speed_mps", obstacle.speed_mps, right)
    still = bool(obstacle.waypoints_m) and all(point == obstacle.center_m for point in obstacle.waypoints_m)
    _require(not still, f"{where}.waypoints_m", list(obstacle.center_m), "a place other than center_m")
    if obstacle.velocity_mps is not None:
        fast_enough = SPEED_MPS_MIN <= hypot(*obstacle.velocity_mps) <= SPEED_MPS_MAX
        _require(fast_enough, f"{where}.velocity_mps", list(obstacle.velocity_mps), "from 0.001 to 10 m/s")
    if obstacle.walk_m is not None:
        right = "a number from speed_mps (the way of one second) to 1000"
        _require(obstacle.speed_mps <= obstacle.walk_m <= 1e3, f"{where}.walk_m", obstacle.walk_m, right)


def _convex(corners_m: tuple[Point, ...]) -> bool:
    """Return True if every corner turns left and the corners turn once around in all (a pentagram turns twice)."""
    if len(corners_m) < 3:
        return False
    turned_rad = 0.0
    for n, (cx, cy) in enumerate(corners_m):
        (ax, ay), (bx, by) = corners_m[n - 2], corners_m[n - 1]
        across = (bx - ax) * (cy - by) - (by - ay) * (cx - bx)
        if across <= LENGTH_M_MIN**2:
            return False
        turned_rad += atan2(across, (bx - ax) * (cx - bx) + (by - ay) * (cy - by))
    return turned_rad < 1.5 * TAU


def _require(fine: bool, where: str, value: object, right: str) -> None:
    if not fine:
        raise Refused(f"{where} = {value}: must be {right}")
