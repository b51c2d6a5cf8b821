"""The scenario type: a mission, a world, radio weather, faults and a time limit; and what no world can be built from.

Names carry their units. `world/scenario.py` reads it from TOML, `world/course.py` says what a seed draws of it.
Nothing here imports the engine: a launcher, a test or an editor reads a scenario in milliseconds.
"""

from __future__ import annotations

from math import hypot, pi
from typing import Literal

from msgspec import Struct, field

from protocol.mission import Mission, Refused, check_mission, robot_name
from protocol.radio import Radio
from world.terrain import Bump, Ditch, Pothole, check_feature, features

Point = tuple[float, float]
ROBOTS_MAX = 500
LENGTH_M_MIN = 0.001
PHYSICS_HZ_MIN, PHYSICS_HZ_MAX = 100.0, 1000.0
STATE = "state.json"
"""Where a world keeps in its run folder what it remembers over its own death (`memory.py`)."""


class Obstacle(Struct, frozen=True, forbid_unknown_fields=True):
    """A body that robots see and bump into: `radius_m` makes it round, `corners_m` a convex polygon."""

    center_m: Point
    radius_m: float | None = None
    corners_m: tuple[Point, ...] | None = None
    """Relative to `center_m`, counter-clockwise."""
    mass_kg: float | None = None
    """None: nailed to the floor; otherwise robots can push it."""
    waypoints_m: tuple[Point, ...] = ()
    """A moving obstacle goes to and fro along center_m -> waypoints_m at `speed_mps`, whatever it meets."""
    speed_mps: float = 0.0
    phase: float = 0.0
    """Where on its way there and back it starts: 0 at `center_m`, 0.5 at the last way-point."""
    velocity_mps: Point | None = None
    """Another way of moving: straight on, for ever."""
    walk_m: float | None = None
    """Another: a random walk at `speed_mps` within this of `center_m`, drawn by the seed."""
    walk_seed: int = 0
    """Set by `draw`."""

    @property
    def moves(self) -> bool:
        return bool(self.waypoints_m) or self.velocity_mps is not None or self.walk_m is not None


class Body(Struct, frozen=True, forbid_unknown_fields=True):
    """The simulated robots' bodies; the radius is the mission's."""

    mass_kg: float = 5.0
    push_n: float = 40.0
    """Largest force of the wheels on the ground: what a robot can push, and how steep a contact it climbs."""
    wheel_radius_m: float = 0.05


class Lidar(Struct, frozen=True, forbid_unknown_fields=True):
    beams: int = 180
    range_min_m: float = 0.05
    range_max_m: float = 8.0
    rate_hz: float = 10.0


class Ground(Struct, frozen=True, forbid_unknown_fields=True):
    """The downward-looking range sensor: points along three lines ahead of the robot's centre, 20 times a second."""

    first_m: float = 0.1
    reach_m: float = 1.5
    increment_m: float = 0.05
    depth_m: float = 1.0
    """A floor that lies deeper is not seen."""


class Noise(Struct, frozen=True, forbid_unknown_fields=True):
    """Standard deviations; all zero is a clean world."""

    localization_m: float = 0.0
    localization_rad: float = 0.0
    localization_dropout: float = 0.0
    """Probability that one fix is missing."""
    odometry: float = 0.0
    """Of the wheels' speed, as a fraction."""
    range_m: float = 0.0
    range_dropout: float = 0.0
    range_outlier: float = 0.0
    """Probability that a beam reads anything between its limits."""
    ground_m: float = 0.0
    ground_dropout: float = 0.0
    ground_outlier: float = 0.0
    """Probability that a height is off by anything up to 0.1 m either way."""


class Vary(Struct, frozen=True, forbid_unknown_fields=True):
    """What the seed draws about the course, uniformly within plus or minus these bounds."""

    obstacles_m: float = 0.0
    starts_m: float = 0.0
    starts_rad: float = 0.0
    moving_phase: bool = False
    """A moving obstacle's start along its way, and its speed within 20 %."""


class WorldSpec(Struct, frozen=True, forbid_unknown_fields=True):
    starts: tuple[tuple[float, float, float], ...] | None = None
    """x [m], y [m], theta [rad] of each robot in `map`; None: the leader at (0, 0, 0), the others in their slots."""
    starts_coincide: bool = False
    """Starts may lie in each other, as the paper's do: such robots meet and see each other once they were apart."""
    start: tuple[float, ...] | None = None
    """x, y [m] and perhaps theta [rad] of the first robot; the others stand behind it, where walls leave room."""
    real_robots: tuple[int, ...] = ()
    """Ids whose hardware is not simulated here but speaks for itself (`lfa-driver`): they are moved as they say."""
    map: str | None = None
    """A ROS `map.yaml`, relative to the scenario's file: its occupied cells become walls when the scenario is read."""
    keepout: str | None = None
    """Another `map.yaml`, whose occupied cells a leader that plans its own route stays out of."""
    walls_m: tuple[tuple[float, float, float, float], ...] = ()
    """Segments x1, y1, x2, y2."""
    obstacles: tuple[Obstacle, ...] = ()
    potholes: tuple[Pothole, ...] = ()
    bumps: tuple[Bump, ...] = ()
    ditches: tuple[Ditch, ...] = ()
    body: Body = Body()
    lidar: Lidar = Lidar()
    ground: Ground = Ground()
    noise: Noise = Noise()
    vary: Vary = Vary()
    physics_hz: float = 100.0


class Assert(Struct, frozen=True, forbid_unknown_fields=True):
    """What must hold at the end of a run besides the goal; a key that is not given is not judged."""

    goal_reached: bool = True
    """False: a run may as well end at its time limit."""
    distance_error_max_m: float | None = None
    """Largest distance error of any follower from when it settled, avoidance and formation changes left out."""
    distance_error_rms_m: float | None = None
    bearing_error_rms_rad: float | None = None
    settled_within_s: float | None = None
    """Every follower within 5 cm of its distance for good, this soon after the start."""
    recovered_within_s: float | None = None
    """The chain closed over a lost leader, this soon after its loss."""
    failover_max_ms: float | None = None
    """From the loss of a leader to the first accepted command of the next."""
    contacts_max: int | None = None
    separation_min_m: float | None = None
    """Between the centres of any two robots, at any time."""
    duration_max_s: float | None = None
    leaders_max: int | None = None
    left_behind_max: int | None = None


class Scenario(Struct, frozen=True, forbid_unknown_fields=True):
    """`mission` is what the team is told; the rest is what the world does to it."""

    title: str
    mission: Mission
    time_limit_s: float
    world: WorldSpec = WorldSpec()
    radio: Radio = Radio()
    restart: dict[str, Literal["never", "on-failure"]] = {}
    """Whether `lfa run` starts a process again that failed: of `router`, `world`, `robots` or one `robot2`."""
    faults: tuple[str, ...] = ()
    """Each as one would say it: 'kill leader at 20 s', 'stop 2 at 5 s for 3 s'."""
    asserted: Assert = field(default=Assert(), name="assert")
    """The table `[assert]`: what `lfa run` and `lfa sim` judge a run by."""
    name: str = ""
    """Set by `load` from the file's name."""


Outcome = Literal["goal_reached", "failed", "time_limit", "aborted", "interrupted"]


def check_scenario(scenario: Scenario) -> Scenario:
    """`scenario`, or `Refused` with the first field of it that no world could be built from."""
    robots = scenario.mission.robots
    _require(len(robots) <= ROBOTS_MAX, "mission.robots", f"{len(robots)} ids", f"at most {ROBOTS_MAX} ids")
    check_mission(scenario.mission)
    for where, value, low, high in _ranges(scenario):
        _require(low <= value <= high, where, value, f"a number from {low:g} to {high:g}")
    for index, obstacle in enumerate(scenario.world.obstacles):
        _check_obstacle(f"world.obstacles[{index}]", obstacle)
    for key, feature in features(scenario.world):
        check_feature(f"world.{key}", feature)
    processes = ("router", "world", "robots", *(robot_name(robot) for robot in robots))
    strange = [robot for robot in scenario.world.real_robots if robot not in robots]
    _require(not strange, "world.real_robots", strange, f"ids among {list(robots)}")
    # E19: a real robot's gateway does not stand or fall with the witness.
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
    """One shape, and at most one way of moving."""
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
    low, high = (0.001, 10.0) if paced else (0.0, 0.0)
    right = "above 0 with waypoints_m or walk_m, and 0 without"
    _require(low <= obstacle.speed_mps <= high, f"{where}.speed_mps", obstacle.speed_mps, right)
    still = bool(obstacle.waypoints_m) and all(point == obstacle.center_m for point in obstacle.waypoints_m)
    _require(not still, f"{where}.waypoints_m", list(obstacle.center_m), "a place other than center_m")
    if obstacle.velocity_mps is not None:
        fast_enough = 0.001 <= hypot(*obstacle.velocity_mps) <= 10.0
        _require(fast_enough, f"{where}.velocity_mps", list(obstacle.velocity_mps), "from 0.001 to 10 m/s")
    if obstacle.walk_m is not None:
        right = "a number from speed_mps (the way of one second) to 1000"
        _require(obstacle.speed_mps <= obstacle.walk_m <= 1e3, f"{where}.walk_m", obstacle.walk_m, right)


def _convex(corners_m: tuple[Point, ...]) -> bool:
    if len(corners_m) < 3:
        return False
    following = corners_m[1:] + corners_m[:1]
    after = corners_m[2:] + corners_m[:2]
    return all(
        (bx - ax) * (cy - by) - (by - ay) * (cx - bx) > LENGTH_M_MIN**2
        for (ax, ay), (bx, by), (cx, cy) in zip(corners_m, following, after, strict=True)
    )


def _require(fine: bool, where: str, value: object, right: str) -> None:
    if not fine:
        raise Refused(f"{where} = {value}: must be {right}")
