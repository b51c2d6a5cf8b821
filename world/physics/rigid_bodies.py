"""Rigid-body physics in the plane (pymunk): two-wheeled robots, walls, and fixed, pushable or moving obstacles.

A robot that touches nothing follows equation (1) exactly: the engine moves a body along a straight line for one
step, so the step is the chord of the arc, which has the arc's ends. A robot in contact is driven by at most the force
that its wheels can exert; beyond that the wheels slip, and odometry drifts as a real robot's does.
Terrain lets a wheel over an edge or not (`wheel_contact.py`), with no limit on the holding force.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, sin

import pymunk

from lfa.protocol.geometry import STILL, Pose2D, Twist, sinc, wrap
from lfa.protocol.names import robot_name
from lfa.world.description.obstacle_motion import Way, way_of
from lfa.world.description.placement import reach_of, starts_of
from lfa.world.description.scenario import Obstacle, Scenario
from lfa.world.physics.kinematics import Drive, Touch
from lfa.world.physics.wheel_contact import Floor

GRAVITY_MPS2 = 9.81
GROUND_FRICTION = 0.4
"""Friction coefficient of a pushable obstacle on the floor: 40 N of push move up to 10 kg."""
SIDE_FRICTION = 0.2
"""Friction coefficient between bodies that touch."""
OVERLAP_M = 0.0005
"""Penetration [m] that bodies may keep, so that a lasting contact counts as one touch."""
OVERLAP_KEPT = 0.8
"""Fraction of a deeper penetration that is left after one step."""
RETOUCH_S = 0.25
"""Longest interruption [s] after which a renewed contact still counts as the same touch."""

_ROBOT, _THING = 1, 2


class Physics:
    """Physics engine with all bodies of a drawn scenario, stepped together; equal calls give equal bits."""

    def __init__(self, scenario: Scenario) -> None:
        world, mission = scenario.world, scenario.mission
        self._dt_s = 1.0 / world.physics_hz
        self._steps = 0
        self._space = pymunk.Space()
        self._space.collision_slop = OVERLAP_M
        self._space.collision_bias = OVERLAP_KEPT**world.physics_hz
        self._names: dict[pymunk.Shape, tuple[int, str]] = {}
        """Robot index (-1 for a wall or obstacle) and name of each shape."""
        self._drives = [Drive(mission.limits) for _ in mission.robots]
        self.poses: list[Pose2D] = list(starts_of(scenario))
        """Pose of each robot's `base_link` in `map`."""
        self.twists: list[Twist] = [STILL] * len(self.poses)
        """Twist of each robot's body in its `base_link`."""
        self.wheels: list[Twist] = [STILL] * len(self.poses)
        """Twist that each robot's wheels roll; differs from `twists` where they slip."""
        mass_kg, radius_m = world.body.mass_kg, mission.radius_m
        self._footprint_m = world.body.footprint_m
        self._inertia = pymunk.moment_for_circle(mass_kg, 0.0, radius_m)
        if self._footprint_m:
            self._inertia = pymunk.moment_for_poly(mass_kg, self._footprint_m)
        self._mass_kg, self._push_n, self._torque_nm = mass_kg, world.body.push_n, world.body.push_n * radius_m
        self._dv_max = self._push_n / self._mass_kg * self._dt_s
        self._dw_max = self._torque_nm / self._inertia * self._dt_s
        """Most that a step changes the speeds [m/s, rad/s] of a robot by, as its wheels grip."""
        self._robots = [self._add_robot(n, robot_name(robot_id), radius_m) for n, robot_id in enumerate(mission.robots)]
        self._velocity = [(0.0, 0.0, 0.0)] * len(self._robots)
        self._floor = Floor(scenario)
        self._rolls: list[Twist] = [STILL] * len(self._robots)
        """Twist of each robot's body that the ground permits in this step."""
        self._jolted = [False] * len(self._robots)
        """True for each robot that lost speed at an edge in the last step."""
        self._touching = [0] * len(self._robots)
        self._parted_at: dict[tuple[int, str], int] = {}
        self._touches: list[Touch] = []
        self._never_apart = _overlapping(self.poses, radius_m)
        """Pairs of robots, by index, that overlapped at the start: they do not collide until they have separated."""
        for n, (x1, y1, x2, y2) in enumerate(world.walls_m):
            self._add_shape(pymunk.Segment(self._space.static_body, (x1, y1), (x2, y2), 0.0), _THING, -1, f"wall{n}")
        self._pushable: dict[int, pymunk.Body] = {}
        self._moving: list[tuple[int, pymunk.Body, Way]] = []
        for n, obstacle in enumerate(world.obstacles):
            self._add_obstacle(n, obstacle)
        for other in (_ROBOT, _THING):
            self._space.on_collision(_ROBOT, other, begin=self._on_begin, separate=self._on_separate)

    def advance(self, steps: int) -> None:
        """Start at step number `steps`: robots stay where the scenario puts them, moving obstacles have moved on."""
        self._steps = steps
        for _, body, way in self._moving:
            body.position = way.at(steps * self._dt_s)

    def step(self, wanted: Sequence[Twist]) -> list[Touch]:
        """Advance one step of 1/physics_hz with the commanded twists, one per robot; return the touches that began."""
        dt_s = self._dt_s
        self._steps += 1
        near = self._floor.all_near(self.poses)
        for n, drive in enumerate(self._drives):
            self.wheels[n] = self._rolls[n] = drive.step(wanted[n], dt_s)
            held_hard = near[n] and self._touching[n] == 0 and self._roll(n, drive)
            self._push(n, self._rolls[n], held_hard)
        for _, body, way in self._moving:
            (x, y), (to_x, to_y) = body.position, way.at(self._steps * dt_s)
            body.velocity = ((to_x - x) / dt_s, (to_y - y) / dt_s)
        held = [touching > 0 for touching in self._touching]
        self._space.step(dt_s)
        for n, body in enumerate(self._robots):
            self._read(n, body, held[n] or self._touching[n] > 0, near[n])
        touches, self._touches = self._touches, []
        touches.sort(key=lambda touch: (touch.robot, touch.other))
        return touches

    def place(self, n: int, pose: Pose2D) -> None:
        """Set the pose of robot `n`, a real one that reports its pose."""
        body = self._robots[n]
        self.poses[n] = pose
        body.position, body.angle = (pose.x, pose.y), pose.theta
        self._space.reindex_shapes_for_body(body)

    def set_down(self, n: int, obstacle: Obstacle) -> None:
        """Add a fixed obstacle under index `n` of the scenario's list."""
        self._add_obstacle(n, obstacle)

    def moved(self) -> dict[int, Pose2D]:
        """Return the pose in `map` of each obstacle that is not fixed, by its index in the scenario's list."""
        poses = {n: Pose2D(*body.position, 0.0) for n, body, _ in self._moving}
        poses.update((n, Pose2D(*body.position, wrap(body.angle))) for n, body in self._pushable.items())
        return dict(sorted(poses.items()))

    def standing_m(self) -> list[float]:
        """Return the height [m] of the ground under each robot."""
        return [self._floor.standing_m(n) for n in range(len(self._robots))]

    def _roll(self, n: int, drive: Drive) -> bool:
        """Apply the ground's limits to the rolling of robot `n`; return True if an edge holds or slows it."""
        wheels, jolted = drive.twist, self._jolted[n]
        self._rolls[n], drive.twist = self._floor.roll(n, self.poses[n], wheels, self.twists[n])
        self._jolted[n] = drive.twist is not wheels
        return jolted or self._rolls[n] is not wheels

    def _push(self, n: int, twist: Twist, held_hard: bool) -> None:
        """Accelerate robot `n` to `twist`, limited by its wheels' grip unless an edge holds it (`held_hard`)."""
        touching = self._touching[n] > 0
        now = self._velocity[n]
        if twist is STILL and not touching and now == (0.0, 0.0, 0.0):
            return
        turn = twist.angular_z * self._dt_s
        chord = twist.linear_x * sinc(0.5 * turn)
        middle = self.poses[n].theta + 0.5 * turn
        dx, dy, dw = chord * cos(middle) - now[0], chord * sin(middle) - now[1], twist.angular_z - now[2]
        if not touching and dx == dy == dw == 0.0:
            return  # the engine keeps the velocity of a body that nothing touches
        if not held_hard:
            dw_max = self._dw_max
            grip = min(1.0, self._dv_max / max(hypot(dx, dy), 1e-12))
            dx, dy, dw = grip * dx, grip * dy, max(-dw_max, min(dw_max, dw))
        body = self._robots[n]
        if touching:
            # Applied as a force, so that the contact reacts within the step: a velocity set now would first
            # penetrate the other body.
            body.force = (self._mass_kg * dx / self._dt_s, self._mass_kg * dy / self._dt_s)
            body.torque = self._inertia * dw / self._dt_s
        else:
            self._velocity[n] = now[0] + dx, now[1] + dy, now[2] + dw
            body.velocity = self._velocity[n][:2]
            body.angular_velocity = self._velocity[n][2]

    def _read(self, n: int, body: pymunk.Body, touched: bool, near: bool) -> None:
        if not touched and self._velocity[n] == (0.0, 0.0, 0.0):
            self.twists[n] = STILL
            return
        x, y = body.position
        pose = Pose2D(x, y, wrap(body.angle))
        if near and not self._floor.settle(n, pose, self.twists[n]):
            # Pushed, or sliding, against an edge that the wheels cannot climb.
            body.position, body.angle = (self.poses[n].x, self.poses[n].y), self.poses[n].theta
            body.velocity, body.angular_velocity = (0.0, 0.0), 0.0
            self._velocity[n], self.twists[n] = (0.0, 0.0, 0.0), STILL
            return
        self.poses[n] = pose
        if not touched:
            self.twists[n] = self._rolls[n]
            return
        (vx, vy), w, theta = body.velocity, body.angular_velocity, self.poses[n].theta
        self._velocity[n] = (vx, vy, w)
        self.twists[n] = Twist(vx * cos(theta) + vy * sin(theta), w)

    def _add_robot(self, n: int, name: str, radius_m: float) -> pymunk.Body:
        body = pymunk.Body(self._mass_kg, self._inertia)
        body.position, body.angle = (self.poses[n].x, self.poses[n].y), self.poses[n].theta
        self._space.add(body)
        body_shape = pymunk.Poly(body, self._footprint_m) if self._footprint_m else pymunk.Circle(body, radius_m)
        self._add_shape(body_shape, _ROBOT, n, name)
        return body

    def _add_shape(self, shape: pymunk.Shape, kind: int, robot: int, name: str) -> None:
        shape.friction = SIDE_FRICTION
        shape.collision_type = kind
        self._names[shape] = (robot, name)
        self._space.add(shape)

    def _add_obstacle(self, n: int, obstacle: Obstacle) -> None:
        body = pymunk.Body(body_type=pymunk.Body.STATIC)
        if obstacle.moves:
            body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
            way = way_of(obstacle)
            body.position = way.at(0.0)
            self._moving.append((n, body, way))
        else:
            if obstacle.mass_kg is not None:
                body = self._pushable[n] = pymunk.Body(obstacle.mass_kg, _inertia_of(obstacle, obstacle.mass_kg))
            body.position = obstacle.center_m
        self._space.add(body)
        shape: pymunk.Shape
        if obstacle.radius_m is not None:
            shape = pymunk.Circle(body, obstacle.radius_m)
        else:
            shape = pymunk.Poly(body, obstacle.corners_m or ())
            body.center_of_gravity = shape.center_of_gravity
        self._add_shape(shape, _THING, -1, f"obstacle{n}")
        if obstacle.mass_kg is not None:
            self._brake_on_ground(body, obstacle)

    def _brake_on_ground(self, body: pymunk.Body, obstacle: Obstacle) -> None:
        """Add Coulomb friction with the floor: joints that oppose velocity with bounded force and never pull back."""
        center = body.center_of_gravity
        slide = pymunk.PivotJoint(self._space.static_body, body, body.local_to_world(center), center)
        turn = pymunk.GearJoint(self._space.static_body, body, 0.0, 1.0)
        slide.max_bias = turn.max_bias = 0.0
        slide.max_force = GROUND_FRICTION * body.mass * GRAVITY_MPS2
        turn.max_force = slide.max_force * 2.0 / 3.0 * reach_of(obstacle)
        self._space.add(slide, turn)

    def _on_begin(self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: object) -> None:
        if self._pair(arbiter) in self._never_apart:
            arbiter.process_collision = False
            return
        x, y = arbiter.contact_point_set.points[0].point_a
        for shape, against in (arbiter.shapes, arbiter.shapes[::-1]):
            robot, _ = self._names[shape]
            if robot >= 0:
                self._touching[robot] += 1
                other = self._names[against][1]
                parted_at = self._parted_at.pop((robot, other), None)
                if parted_at is None or (self._steps - parted_at) * self._dt_s > RETOUCH_S:
                    self._touches.append(Touch(robot, other, x, y))

    def _on_separate(self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: object) -> None:
        pair = self._pair(arbiter)
        if pair in self._never_apart:
            self._never_apart.remove(pair)
            return
        for shape, against in (arbiter.shapes, arbiter.shapes[::-1]):
            robot, _ = self._names[shape]
            if robot >= 0:
                self._touching[robot] -= 1
                self._parted_at[robot, self._names[against][1]] = self._steps

    def _pair(self, arbiter: pymunk.Arbiter) -> frozenset[int]:
        """Return the indices of the two robots in contact; -1 stands for a wall or obstacle."""
        return frozenset(self._names[shape][0] for shape in arbiter.shapes)


def _overlapping(poses: Sequence[Pose2D], radius_m: float) -> set[frozenset[int]]:
    apart_m = 2.0 * radius_m
    return {
        frozenset((n, other))
        for n, pose in enumerate(poses)
        for other in range(n)
        if hypot(pose.x - poses[other].x, pose.y - poses[other].y) < apart_m
    }


def _inertia_of(obstacle: Obstacle, mass_kg: float) -> float:
    if obstacle.radius_m is not None:
        return float(pymunk.moment_for_circle(mass_kg, 0.0, obstacle.radius_m))
    corners = obstacle.corners_m or ()
    center = pymunk.Poly(None, corners).center_of_gravity
    return float(pymunk.moment_for_poly(mass_kg, corners, (-center.x, -center.y)))
