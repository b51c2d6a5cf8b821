"""Wheel-ground contact: rules for a rigid wheel at an upright edge, and the floor model that applies them.

A robot stands on two driven wheels at the sides of its centre; castors glide over anything. A wheel of radius r
meets an edge when its centre comes over it (in reality up to r earlier). If the rule forbids the climb, that wheel
slips on the spot: odometry continues, and the robot stands or turns about that wheel. If it permits the climb, wheel
and body lose speed together. `traction` is the largest force of the wheels divided by the weight, whether drive or
friction limits it.

The rules are the statics of a wheel on one contact point and the plastic impact on it. With theta the angle of that
contact from straight below, cos(theta) = (r - h) / r for a step of height h:

- At rest the contact force must balance the weight, so it is vertical, theta off the normal: it is within the
  friction cone while tan(theta) <= traction (the friction condition for the first wheel of a driven axle, as in
  Bekker, Introduction to Terrain-Vehicle Systems, 1969).
- At speed v the impact leaves the component at right angles to the contact, v cos(theta), as for the rimless wheel
  (McGeer, Passive dynamic walking, 1990, with the centre's mass alone); kinetic energy then supplies the lift that
  traction cannot.
- A gap of width w below 2r is straddled: the wheel dips by r - sqrt(r^2 - (w/2)^2), or less when it flies over
  (v > 2 sqrt(g r), 1.4 m/s for r = 0.05 m), and then climbs a step of that height.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, atan, cos, inf, sin, sqrt

from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc
from lfa.world.description.placement import starts_of
from lfa.world.description.scenario import Scenario
from lfa.world.description.terrain import Patch, patches_of

GRAVITY_MPS2 = 9.81
WHEEL_SIDE = 0.8
"""Distance of each wheel from the robot's centre, as a fraction of the robot's radius."""
AROUND_M = 0.5
"""Distance [m] a robot moves before the list of patches near it is computed again."""
STEP_M_MAX = 0.1
"""Upper bound [m] of a robot's motion in one step."""


def dip_m(gap_m: float, radius_m: float, speed_mps: float) -> float:
    """Return the depth [m] by which a wheel sinks between the edges of a gap; `inf` if it falls in."""
    flown = inf if speed_mps <= 0.0 else 0.5 * GRAVITY_MPS2 * (gap_m / speed_mps) ** 2
    half_m = 0.5 * gap_m
    return min(flown, inf if half_m >= radius_m else radius_m - sqrt(radius_m * radius_m - half_m * half_m))


def step_m_max(radius_m: float, traction: float) -> float:
    """Return the highest step [m] that a wheel climbs from rest: tan(theta) = traction."""
    return radius_m * (1.0 - 1.0 / sqrt(1.0 + traction * traction))


def gap_m_max(radius_m: float, traction: float) -> float:
    """Return the widest gap w [m], of any depth, that a wheel leaves from rest: sin(theta) = w / 2r at the far edge."""
    return 2.0 * radius_m * traction / sqrt(1.0 + traction * traction)


def speed_after_step(speed_mps: float, step_m: float, radius_m: float, traction: float) -> float | None:
    """Return a wheel's remaining speed [m/s] on top of a step; None if it cannot climb it.

    From the contact angle down to the friction angle gravity exceeds traction; the difference, the integral of
    g (sin - traction cos) r over that angle, is taken from the kinetic energy.
    """
    if step_m <= 0.0:
        return speed_mps
    if step_m >= radius_m:
        return None
    contact, friction = acos((radius_m - step_m) / radius_m), atan(traction)
    left = (speed_mps * cos(contact)) ** 2
    if contact > friction:
        lift = cos(friction) - cos(contact) - traction * (sin(contact) - sin(friction))
        left -= 2.0 * GRAVITY_MPS2 * radius_m * lift
    return sqrt(left) if left >= 0.0 else None


class Floor:
    """Floor model of a drawn scenario: the patch under each wheel, and the motions that edges permit."""

    def __init__(self, scenario: Scenario) -> None:
        body, poses = scenario.world.body, starts_of(scenario)
        self._patches = patches_of(scenario.world)
        self._robot_radius_m = scenario.mission.radius_m
        self._side_m = WHEEL_SIDE * scenario.mission.radius_m
        self._radius_m = body.wheel_radius_m
        self._traction = body.push_n / (body.mass_kg * GRAVITY_MPS2)
        self._dt_s = 1.0 / scenario.world.physics_hz
        self._looked_at = [(inf, inf)] * len(poses)
        self._obstacles: list[list[Patch]] = [[] for _ in poses]
        self._under: list[list[Patch | None]] = [[None, None] for _ in poses]
        """Patch under the left and the right wheel of each robot; None is the floor at height 0."""
        self._height_m = [[0.0, 0.0] for _ in poses]
        for n, pose in enumerate(poses):  # in a resumed world robots may stand in holes
            self.near(n, pose)
            for wheel in (0, 1):
                edge = self._edge(n, wheel, pose, 0.0)
                if edge is not None:
                    self._under[n][wheel], self._height_m[n][wheel] = edge

    def near(self, n: int, pose: Pose2D) -> bool:
        """Return True if robot number `n` at `pose` may reach a patch in this step."""
        if not self._patches:
            return False
        x, y = self._looked_at[n]
        if not (x - pose.x) ** 2 + (y - pose.y) ** 2 < AROUND_M * AROUND_M:
            self._looked_at[n] = pose.x, pose.y
            within_m = AROUND_M + self._robot_radius_m + STEP_M_MAX
            self._obstacles[n] = [patch for patch in self._patches if patch.gap_m(pose.x, pose.y) <= within_m]
        return bool(self._obstacles[n])

    def all_near(self, poses: Sequence[Pose2D]) -> list[bool]:
        """Return `near` of all robots; on a floor without patches nobody looks for one."""
        return [self.near(n, pose) for n, pose in enumerate(poses)] if self._patches else [False] * len(poses)

    def standing_m(self, n: int) -> float:
        """Return the height [m] of the ground under robot `n`, the mean over its two wheels."""
        left_m, right_m = self._height_m[n]
        return 0.5 * (left_m + right_m)

    def roll(self, n: int, pose: Pose2D, wanted: Twist, body: Twist) -> tuple[Twist, Twist]:
        """Return the twist of robot `n`'s body in the next step, and the twist that its wheels roll after it.

        The wheels roll `wanted`, and the body has moved with `body` until now. A wheel that cannot climb an edge keeps
        slipping; one that climbs an edge loses speed on top of it.
        """
        rims, speeds = self._of_wheels(wanted), [abs(v) for v in self._of_wheels(body)]
        rolling = rims
        for _ in rims:  # a held wheel changes the other one's path, perhaps towards another edge
            through = wanted if rolling is rims else self._of_body(rolling)
            ahead = along_arc(pose, through, self._dt_s)
            afters = [self._after(n, wheel, ahead, speeds[wheel]) for wheel in (0, 1)]
            if all(rim == 0.0 or after is not None for rim, after in zip(rolling, afters, strict=True)):
                return through, self._slowed(wanted, rims, speeds, afters)
            rolling = [0.0 if after is None else rim for rim, after in zip(rolling, afters, strict=True)]
        return STILL, wanted

    def settle(self, n: int, pose: Pose2D, body: Twist) -> bool:
        """Update the ground under the wheels for `pose`; return False, unchanged, if a wheel cannot have got there.

        `body` is as in `roll`. Only a robot that is pushed, or slides, reaches a pose to which its wheels cannot roll.
        """
        speeds = self._of_wheels(body)
        found: list[tuple[int, Patch | None, float]] = []
        for wheel in (0, 1):
            if self._after(n, wheel, pose, abs(speeds[wheel])) is None:
                return False
            edge = self._edge(n, wheel, pose, abs(speeds[wheel]))
            if edge is not None:
                found.append((wheel, *edge))
        for wheel, patch, height_m in found:
            self._under[n][wheel], self._height_m[n][wheel] = patch, height_m
        return True

    def _after(self, n: int, wheel: int, pose: Pose2D, speed_mps: float) -> float | None:
        """Return the wheel's speed with the robot at `pose`, after any edge it crosses; None if it cannot get there."""
        edge = self._edge(n, wheel, pose, speed_mps)
        if edge is None:
            return speed_mps
        return speed_after_step(speed_mps, edge[1] - self._height_m[n][wheel], self._radius_m, self._traction)

    def _edge(self, n: int, wheel: int, pose: Pose2D, speed_mps: float) -> tuple[Patch | None, float] | None:
        """Return the new patch under the wheel and its height [m]; None if the wheel stays on its present patch."""
        c, s = cos(pose.theta), sin(pose.theta)
        beside = self._side_m if wheel == 0 else -self._side_m
        x, y = pose.x - beside * s, pose.y + beside * c
        patch = next((patch for patch in self._obstacles[n] if patch.covers(x, y)), None)
        if patch is self._under[n][wheel]:
            return None
        if patch is None:
            return None, 0.0
        if patch.height_m > 0.0:
            return patch, patch.height_m
        return patch, -min(-patch.height_m, dip_m(patch.chord_m(x, y, c, s), self._radius_m, speed_mps))

    def _slowed(self, wanted: Twist, rims: list[float], speeds: list[float], afters: list[float | None]) -> Twist:
        if all(after is None or after >= speed for after, speed in zip(afters, speeds, strict=True)):
            return wanted
        slowed = [
            rim if after is None or after >= speed else max(-after, min(after, rim))
            for rim, speed, after in zip(rims, speeds, afters, strict=True)
        ]
        return self._of_body(slowed)

    def _of_wheels(self, twist: Twist) -> list[float]:
        """Return the speeds [m/s] of the left and the right wheel over the ground."""
        turn = self._side_m * twist.angular_z
        return [twist.linear_x - turn, twist.linear_x + turn]

    def _of_body(self, speeds: list[float]) -> Twist:
        left, right = speeds
        return Twist(0.5 * (left + right), 0.5 * (right - left) / self._side_m) if left or right else STILL
