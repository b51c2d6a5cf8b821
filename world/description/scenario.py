"""The scenario type: a mission, a world, link conditions, faults and a time limit.

Names carry their units. `world/description/load.py` reads a scenario from TOML, `world/description/checks.py` checks
its values, `world/description/placement.py` draws its random variations.
Nothing here may import the engine: a launcher, a test or an editor reads a scenario in milliseconds.
"""

from __future__ import annotations

from typing import Literal

from msgspec import Struct, field

from lfa.protocol.geometry import TAU
from lfa.protocol.mission import Mission, Parameter
from lfa.protocol.transport.link_model import Radio
from lfa.world.description.terrain import Bump, Ditch, Pothole

Point = tuple[float, float]
SPEED_MPS_MIN, SPEED_MPS_MAX = 0.001, 10.0
"""Least and greatest speed [m/s] of a moving obstacle."""
RADIUS_M_MIN, RADIUS_M_MAX, PLACE_M_MAX = 0.05, 5.0, 1e4
"""Least and greatest radius [m], and farthest place [m] along each axis, of an obstacle set down during a run."""
STATE = "state.json"
"""Name of the world's checkpoint in the run folder (`checkpoint.py`)."""


class Obstacle(Struct, frozen=True, forbid_unknown_fields=True):
    """Body that robots see and collide with: round with `radius_m`, or a convex polygon with `corners_m`."""

    center_m: Point
    radius_m: float | None = None
    corners_m: tuple[Point, ...] | None = None
    """Corners [m] relative to `center_m`, counter-clockwise."""
    mass_kg: float | None = None
    """Mass [kg] of an obstacle that robots can push; None: fixed to the floor."""
    waypoints_m: tuple[Point, ...] = ()
    """Motion to and fro along center_m -> waypoints_m at `speed_mps`; collisions do not deflect it."""
    speed_mps: float = 0.0
    phase: float = 0.0
    """Initial phase of the motion to and fro, in [0, 1): 0 at `center_m`, 0.5 at the last way-point."""
    velocity_mps: Point | None = None
    """Constant velocity [m/s] in `map`, without end; an alternative to `waypoints_m`."""
    walk_m: float | None = None
    """Radius [m] around `center_m` of a random walk at `speed_mps`, drawn by the seed; another alternative."""
    walk_seed: int = 0
    """Seed of the random walk, set by `draw`."""

    @property
    def moves(self) -> bool:
        return bool(self.waypoints_m) or self.velocity_mps is not None or self.walk_m is not None


class Body(Struct, frozen=True, forbid_unknown_fields=True):
    """Bodies of the simulated robots, within the circle of the mission's radius."""

    mass_kg: float = 5.0
    push_n: float = 40.0
    """Largest force [N] of the wheels on the ground; limits what a robot can push and how steep a contact it climbs."""
    wheel_radius_m: float = 0.05
    footprint_m: tuple[Point, ...] = ()
    """Corners x, y [m] of a body that is a convex polygon, in `base_link`, counter-clockwise around its origin. Empty:
    that of `mission.footprint_m`, else the body is round. The robots know it, as if their mission had it."""


class Lidar(Struct, frozen=True, forbid_unknown_fields=True):
    """Laser scanner of each robot. Its scans are published as seen from `base_link`, wherever it is mounted."""

    beams: int = 180
    """Number of beams, at least 4. 0: robots have no scanner. They see no obstacle and no wall, so that none may be
    there, and drive on open ground, along a route or to a goal; of each other they know what they say."""
    range_min_m: float = 0.05
    range_max_m: float = 8.0
    rate_hz: float = 10.0
    fov_rad: float = TAU
    """Field of view [rad], centred on the scanner's own x axis; what lies outside of it is not seen."""
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Mounting pose x, y [m], theta [rad] in `base_link`."""

    @property
    def fitted(self) -> bool:
        """False for robots without a scanner."""
        return self.beams != 0

    @property
    def beams_a_turn(self) -> int:
        """Number of beams that a full turn would have."""
        return round(self.beams * TAU / self.fov_rad)


class Ground(Struct, frozen=True, forbid_unknown_fields=True):
    """Downward-looking range sensor: points along three lines ahead of the robot's centre, 20 times a second."""

    first_m: float = 0.1
    reach_m: float = 1.5
    increment_m: float = 0.05
    depth_m: float = 1.0
    """Greatest depth [m] measured; a deeper floor is not seen."""


class ChosenSensor(Struct, frozen=True, forbid_unknown_fields=True):
    """Sensor of a user's own, on every simulated robot."""

    rate_hz: float = 10.0
    """Rate [Hz] at which each robot's sensor measures."""
    parameters: dict[str, Parameter] = {}
    """Parameters of the sensor itself, by the names and types that its class gives in `Parameters`."""


class Noise(Struct, frozen=True, forbid_unknown_fields=True):
    """Standard deviations and error probabilities of the sensors; with all at zero the sensors are exact."""

    localization_m: float = 0.0
    localization_rad: float = 0.0
    localization_dropout: float = 0.0
    """Probability that one fix is missing."""
    odometry: float = 0.0
    """Standard deviation of the measured wheel speed, as a fraction of it."""
    range_m: float = 0.0
    range_dropout: float = 0.0
    range_outlier: float = 0.0
    """Probability that a beam returns a random range between its limits."""
    ground_m: float = 0.0
    ground_dropout: float = 0.0
    ground_outlier: float = 0.0
    """Probability that a height has a random error of up to 0.1 m either way."""


class Vary(Struct, frozen=True, forbid_unknown_fields=True):
    """Bounds of the seed's random variations, drawn uniformly within plus or minus each."""

    obstacles_m: float = 0.0
    starts_m: float = 0.0
    starts_rad: float = 0.0
    moving_phase: bool = False
    """Draw each moving obstacle's initial phase, and its speed within 20 %."""


class SpareRobot(Struct, frozen=True, forbid_unknown_fields=True):
    """Robot that stands in the world, and that the mission does not name: `lfa join` takes it into the team."""

    id: int
    start: tuple[float, float, float]
    """Start x [m], y [m], theta [rad] in `map`."""


class WorldSpec(Struct, frozen=True, forbid_unknown_fields=True):
    """Simulated world: starts, walls, obstacles, terrain, bodies, sensors and their noise."""

    starts: tuple[tuple[float, float, float], ...] | None = None
    """Start x [m], y [m], theta [rad] of each robot in `map`; None: the leader at (0, 0, 0), the others in slots."""
    starts_coincide: bool = False
    """Starts may overlap, as the paper's do: such robots collide with and see each other only after they separated."""
    start: tuple[float, ...] | None = None
    """Start x, y [m] and optionally theta [rad] of the first robot; the others stand behind it where walls permit."""
    spares: tuple[SpareRobot, ...] = ()
    """Robots beside the mission's, for `lfa join`."""
    real_robots: tuple[int, ...] = ()
    """Ids of robots with a driver of their own (`lfa-driver`): not simulated, their bodies follow reported poses, and
    drive on as last reported when their driver falls silent."""
    map: str | None = None
    """ROS `map.yaml`, relative to the scenario's file; its occupied cells become walls when the scenario is read."""
    keepout: str | None = None
    """Keepout mask, another `map.yaml`; a leader that plans its own route avoids its occupied cells."""
    walls_m: tuple[tuple[float, float, float, float], ...] = ()
    """Wall segments x1, y1, x2, y2 [m] in `map`."""
    obstacles: tuple[Obstacle, ...] = ()
    potholes: tuple[Pothole, ...] = ()
    bumps: tuple[Bump, ...] = ()
    ditches: tuple[Ditch, ...] = ()
    body: Body = Body()
    lidar: Lidar = Lidar()
    ground: Ground = Ground()
    noise: Noise = Noise()
    sensors: dict[str, ChosenSensor] = {}
    """Sensors of a user's own by their names (entry points `lfa.sensors`)."""
    vary: Vary = Vary()
    physics_hz: float = 100.0


class Assert(Struct, frozen=True, forbid_unknown_fields=True):
    """Assertions checked at the end of a run; a key that is not given is not checked."""

    goal_reached: bool = True
    """Require that the goal is reached; False: the run may also end at its time limit."""
    distance_error_max_m: float | None = None
    """Largest distance error [m] of any follower after it settled, excluding avoidance and formation changes."""
    distance_error_rms_m: float | None = None
    bearing_error_rms_rad: float | None = None
    settled_within_s: float | None = None
    """Time [s] after the start by which every follower stays within 5 cm of its distance."""
    recovered_within_s: float | None = None
    """Time [s] after the loss of a leader by which the chain has closed over it."""
    failover_max_ms: float | None = None
    """Largest time [ms] from the loss of a leader to the first accepted command of the next."""
    contacts_max: int | None = None
    separation_min_m: float | None = None
    """Least distance [m] between the centres of any two robots, at any time."""
    duration_max_s: float | None = None
    leaders_max: int | None = None
    left_behind_max: int | None = None
    """Largest number of robots left behind; 0 for a run that reaches its goal, where it is not given."""


class Generator(Struct, frozen=True, forbid_unknown_fields=True):
    """Choice of a scenario generator, which `draw` calls."""

    name: str
    """Name of an installed scenario generator (entry point `lfa.scenarios`)."""
    parameters: dict[str, Parameter] = {}
    """Parameters of the generator itself, by the names and types that its class gives in `Parameters`."""


class Scenario(Struct, frozen=True, forbid_unknown_fields=True):
    """Complete description of a run: `mission` is sent to the team, the rest configures the world around it."""

    title: str
    mission: Mission
    time_limit_s: float
    world: WorldSpec = WorldSpec()
    generator: Generator | None = None
    """Generator that draws the course from the seed; a drawn scenario has none."""
    radio: Radio = Radio()
    restart: dict[str, Literal["never", "on-failure"]] = {}
    """Restart policy of `lfa run` for a failed process: keys `router`, `world`, `robots`, or one as `robot2`."""
    faults: tuple[str, ...] = ()
    """Faults to inject, as sentences: 'kill leader at 20 s', 'stop 2 at 5 s for 3 s'."""
    asserted: Assert = field(default=Assert(), name="assert")
    """Assertions of the table `[assert]`, checked by `lfa run` and `lfa sim`."""
    name: str = ""
    """Name of the scenario, set by `load`: `saved_from`, else the file's name."""
    seed: int = 0
    """Seed of a run for which the command line gives none."""
    saved_from: str = ""
    """Name of the scenario that this file is a saved session of (`lfa web`): its runs bear that name."""

    @property
    def robots(self) -> tuple[int, ...]:
        """Ids of all robots in the world: those of the mission, then the spares."""
        return (*self.mission.robots, *(spare.id for spare in self.world.spares))


Outcome = Literal["goal_reached", "failed", "time_limit", "aborted", "interrupted", "recorded"]
"""How a run ended; `recorded`: it went on when its recording ended."""
