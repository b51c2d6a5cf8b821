"""The scenario type: a mission, a world, radio weather, faults and a time limit.

Names carry their units. `world/description/load.py` reads it from TOML, `world/description/checks.py` says what no
world can be built from, `world/description/placement.py` what a seed draws of it.
Nothing here imports the engine: a launcher, a test or an editor reads a scenario in milliseconds.
"""

from __future__ import annotations

from typing import Literal

from msgspec import Struct, field

from lfa.protocol.mission import Mission
from lfa.protocol.transport.link_model import Radio
from lfa.world.description.terrain import Bump, Ditch, Pothole

Point = tuple[float, float]
SPEED_MPS_MIN, SPEED_MPS_MAX = 0.001, 10.0
"""Of an obstacle that moves."""
STATE = "state.json"
"""Where a world keeps in its run folder what it remembers over its own death (`checkpoint.py`)."""


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
