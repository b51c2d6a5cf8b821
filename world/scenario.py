"""The scenario type: a mission, a world, radio weather, faults and a time limit, read from TOML.

Names carry their units. An unknown key, a wrong type or an impossible value is refused with one line that says the
file, the key, the value and what would be right. `load` finds shipped scenarios by name and others by path;
`--set a.b=value` overrides any field.
"""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from protocol.mission import Mission

Point = tuple[float, float]


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


class Body(Struct, frozen=True, forbid_unknown_fields=True):
    """The simulated robots' bodies; the radius is the mission's."""

    mass_kg: float = 5.0
    push_n: float = 40.0
    """Largest force of the wheels on the ground: what a robot can push."""


class Lidar(Struct, frozen=True, forbid_unknown_fields=True):
    beams: int = 180
    range_min_m: float = 0.05
    range_max_m: float = 8.0
    rate_hz: float = 10.0


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
    walls_m: tuple[tuple[float, float, float, float], ...] = ()
    """Segments x1, y1, x2, y2."""
    obstacles: tuple[Obstacle, ...] = ()
    body: Body = Body()
    lidar: Lidar = Lidar()
    noise: Noise = Noise()
    vary: Vary = Vary()
    physics_hz: float = 100.0


class Radio(Struct, frozen=True, forbid_unknown_fields=True):
    """Weather between robots, in virtual time and (through `protocol/radio.py`) on a live bus."""

    delay_s: float = 0.0005
    jitter_s: float = 0.001
    """Uniform, on top of `delay_s`."""
    loss: float = 0.0


class Scenario(Struct, frozen=True, forbid_unknown_fields=True):
    """`mission` is what the team is told; the rest is what the world does to it."""

    title: str
    mission: Mission
    time_limit_s: float
    world: WorldSpec = WorldSpec()
    radio: Radio = Radio()
    faults: tuple[str, ...] = ()
    """Each as one would say it: 'kill leader at 20 s', 'stop 2 at 5 s for 3 s'."""
    name: str = ""
    """Set by `load` from the file's name."""


Outcome = Literal["goal_reached", "failed", "time_limit", "aborted", "interrupted"]
