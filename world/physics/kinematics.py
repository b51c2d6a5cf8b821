"""Robots that go exactly where their wheels turn, pass through everything and over any terrain: no engine.

The same shape as `physics.Physics`, for fuzzing what robots say to each other at the speed of arithmetic; and the
parts that both share: a drive with its limits, and the way of a moving obstacle.
"""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import Struct

from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc
from lfa.protocol.mission import Limits
from lfa.world.description.obstacle_motion import way_of
from lfa.world.description.placement import starts_of
from lfa.world.description.scenario import Scenario


class Touch(Struct, frozen=True, gc=False):
    """Robot number `robot` (by place in the mission's list) began to touch `other` at (x, y) in `map`."""

    robot: int
    other: str
    """`robot3`, `wall2`, `obstacle5`: robots by id, the rest by place in the scenario's list."""
    x: float
    y: float


class Drive:
    """The wheels of one robot: they follow the commanded twist within the limits of speed and acceleration."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.twist = STILL
        """What the wheels turn for, whatever the body does."""

    def step(self, wanted: Twist, dt_s: float) -> Twist:
        """The wheels' twist during the next `dt_s`."""
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
    """All robots of a drawn scenario, stepped together; obstacles that move do, and nobody meets anybody."""

    def __init__(self, scenario: Scenario) -> None:
        self._dt_s = 1.0 / scenario.world.physics_hz
        self._steps = 0
        self._drives = [Drive(scenario.mission.limits) for _ in scenario.mission.robots]
        self._ways = {n: way_of(o) for n, o in enumerate(scenario.world.obstacles) if o.moves}
        self.poses: list[Pose2D] = list(starts_of(scenario))
        """Of each robot's `base_link` in `map`."""
        self.twists: list[Twist] = [STILL] * len(self.poses)
        """Of each robot's body in its `base_link`."""
        self.wheels: list[Twist] = [STILL] * len(self.poses)
        """What each robot's wheels turn for; differs from `twists` where they slip."""

    def advance(self, steps: int) -> None:
        """Begin at that step: robots stand where the scenario says, obstacles on their ways are further."""
        self._steps = steps

    def step(self, wanted: Sequence[Twist]) -> list[Touch]:
        """One step of 1/physics_hz with these commanded twists, one a robot."""
        self._steps += 1
        for n, drive in enumerate(self._drives):
            twist = drive.step(wanted[n], self._dt_s)
            if twist is not STILL:
                self.poses[n] = along_arc(self.poses[n], twist, self._dt_s)
            self.wheels[n] = self.twists[n] = twist
        return []

    def place(self, n: int, pose: Pose2D) -> None:
        """Put robot `n` there: it is a real one, and says so."""
        self.poses[n] = pose

    def moved(self) -> dict[int, Pose2D]:
        """The pose in `map` of each obstacle that is not nailed down, by its place in the scenario's list."""
        time_s = self._steps * self._dt_s
        return {n: Pose2D(*way.at(time_s), 0.0) for n, way in self._ways.items()}

    def standing_m(self) -> list[float]:
        """Height [m] of what each robot stands on: the floor, whatever the terrain."""
        return [0.0] * len(self.poses)
