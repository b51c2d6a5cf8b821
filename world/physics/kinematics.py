"""Kinematic model without an engine: robots follow their wheels exactly, through everything and over any terrain.

It has the interface of `rigid_bodies.Physics` and serves fast fuzzing of the protocol. The drive with its limits and
the touch event, which both models share, also live here.
"""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import Struct

from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc
from lfa.protocol.mission import Limits
from lfa.world.description.obstacle_motion import way_of
from lfa.world.description.placement import starts_of
from lfa.world.description.scenario import Obstacle, Scenario


class Touch(Struct, frozen=True, gc=False):
    """Start of a contact between robot number `robot` (index in the mission's list) and `other` at (x, y) in `map`."""

    robot: int
    other: str
    """Name of the other body, `robot3`, `wall2` or `obstacle5`: robots by id, the rest by index in the scenario."""
    x: float
    y: float


class Drive:
    """Wheel drive of one robot: tracks the commanded twist within the limits of speed and acceleration."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.twist = STILL
        """Twist that the wheels roll, independent of the body's motion."""

    def step(self, wanted: Twist, dt_s: float) -> Twist:
        """Update and return the wheels' twist for the next `dt_s`."""
        if wanted is self.twist:
            return self.twist
        limits, now = self._limits, self.twist
        linear = min(limits.v_max_mps, max(-limits.v_reverse_max_mps, wanted.linear_x))
        angular = min(limits.omega_max_radps, max(-limits.omega_max_radps, wanted.angular_z))
        dv, dw = limits.a_max_mps2 * dt_s, limits.alpha_max_radps2 * dt_s
        linear = min(now.linear_x + dv, max(now.linear_x - dv, linear))
        angular = min(now.angular_z + dw, max(now.angular_z - dw, angular))
        reached = linear == wanted.linear_x and angular == wanted.angular_z
        self.twist = wanted if reached else Twist(linear, angular)
        return self.twist


class Kinematic:
    """Robots and moving obstacles of a drawn scenario, stepped together without collisions."""

    def __init__(self, scenario: Scenario) -> None:
        self._dt_s = 1.0 / scenario.world.physics_hz
        self._steps = 0
        self._drives = [Drive(scenario.mission.limits) for _ in scenario.mission.robots]
        self._ways = {n: way_of(o) for n, o in enumerate(scenario.world.obstacles) if o.moves}
        self.poses: list[Pose2D] = list(starts_of(scenario))
        """Pose of each robot's `base_link` in `map`."""
        self.twists: list[Twist] = [STILL] * len(self.poses)
        """Twist of each robot's body in its `base_link`."""
        self.wheels: list[Twist] = [STILL] * len(self.poses)
        """Twist that each robot's wheels roll; always equal to `twists` here."""

    def advance(self, steps: int) -> None:
        """Start at step number `steps`: robots stay where the scenario puts them, moving obstacles have moved on."""
        self._steps = steps

    def step(self, wanted: Sequence[Twist]) -> list[Touch]:
        """Advance one step of 1/physics_hz with the commanded twists, one per robot; return no touches."""
        self._steps += 1
        for n, drive in enumerate(self._drives):
            twist = drive.step(wanted[n], self._dt_s)
            if twist is not STILL:
                self.poses[n] = along_arc(self.poses[n], twist, self._dt_s)
            self.wheels[n] = self.twists[n] = twist
        return []

    def place(self, n: int, pose: Pose2D) -> None:
        """Set the pose of robot `n`, a real one that reports its pose."""
        self.poses[n] = pose

    def set_down(self, n: int, obstacle: Obstacle) -> None:
        """Add nothing: in this model robots drive through obstacles."""

    def moved(self) -> dict[int, Pose2D]:
        """Return the pose in `map` of each moving obstacle, by its index in the scenario's list."""
        time_s = self._steps * self._dt_s
        return {n: Pose2D(*way.at(time_s), 0.0) for n, way in self._ways.items()}

    def standing_m(self) -> list[float]:
        """Return the height [m] under each robot: always the floor, 0."""
        return [0.0] * len(self.poses)
