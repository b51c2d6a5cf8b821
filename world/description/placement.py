"""Placement of a scenario in the plane: start poses, their distances to obstacles, and the seed's random variations."""

from __future__ import annotations

from itertools import pairwise
from math import cos, hypot, pi, sin, sqrt
from random import Random

from msgspec.structs import replace

from lfa.protocol.errors import Refused
from lfa.protocol.geometry import TAU, Pose2D, compose
from lfa.protocol.mission import Mission
from lfa.world.description.obstacle_motion import way_of
from lfa.world.description.scenario import SPEED_MPS_MAX, SPEED_MPS_MIN, Obstacle, Point, Scenario
from lfa.world.description.terrain import Ditch, Feature, features, patch_of, patches_of

DRAW_MARGIN_M = 0.5
"""Minimum distance [m] of drawn obstacles from the robots' starts and from the goal, beyond their radius."""
SEED_MAX = 2**63 - 1
WALK_SEED_BITS = 29
"""Bits of a drawn walk seed, within the number range of a scenario file: drawn scenarios are written and read again."""
DRAWS_MAX = 50
"""Draws tried for an obstacle or a start; if no draw finds room, it stays where the scenario puts it."""


def starts_of(scenario: Scenario) -> tuple[Pose2D, ...]:
    """Return the start pose in `map` of each robot: as given, or the leader at (0, 0, 0) and the others in slots."""
    given = scenario.world.starts
    if given is not None:
        return tuple(Pose2D(*pose) for pose in given)
    poses = [Pose2D()]
    for hop in range(len(scenario.mission.robots) - 1):
        poses.append(compose(poses[-1], _slot(scenario.mission, hop)))
    return tuple(poses)


def with_spares(scenario: Scenario) -> Scenario:
    """Return a scenario whose mission has the spares as robots, each at its start: the bodies of the whole world."""
    spares = scenario.world.spares
    if not spares:
        return scenario
    starts = (*((pose.x, pose.y, pose.theta) for pose in starts_of(scenario)), *(spare.start for spare in spares))
    mission = replace(scenario.mission, robots=scenario.robots)
    return replace(scenario, mission=mission, world=replace(scenario.world, starts=starts, spares=()))


def slot_bearing(mission: Mission, hop: int) -> float:
    """Return phi^d [rad] of follower number `hop` in its predecessor's `base_link` (control.md section 4)."""
    left = pi - mission.formation.angle_rad
    sides = {"left": left, "right": -left, "column": pi, "zigzag": left if hop % 2 == 0 else -left}
    return sides[mission.formation.side]


def _slot(mission: Mission, hop: int) -> Pose2D:
    k, phi = mission.formation.separation_m, slot_bearing(mission, hop)
    return Pose2D(k * cos(phi), k * sin(phi), 0.0)


def as_it_begins(obstacle: Obstacle) -> Obstacle:
    """Return the obstacle with its centre where it is at the world's time 0."""
    return replace(obstacle, center_m=way_of(obstacle).at(0.0)) if obstacle.moves else obstacle


def varied(scenario: Scenario, seed: int) -> Scenario:
    """Draw a concrete scenario from `scenario` and `seed`, with starts given and nothing left to vary.

    Each start and each obstacle has its own generator, so an added obstacle does not move the others. Raises Refused
    for a seed beyond `SEED_MAX`, which no journal could hold.
    """
    if not -SEED_MAX <= seed <= SEED_MAX:
        raise Refused(f"--seed {seed}: must be from -{SEED_MAX} to {SEED_MAX}")
    vary, world = scenario.world.vary, scenario.world
    goal = scenario.mission.goal_m
    anchors = [*((pose.x, pose.y) for pose in starts_of(scenario)), goal]
    margin_m = scenario.mission.radius_m + vary.starts_m + DRAW_MARGIN_M
    obstacles: list[Obstacle] = []
    for n, obstacle in enumerate(_draw_walks(world.obstacles, seed)):
        chance = Random(f"{seed}/obstacle{n}")
        if vary.moving_phase:
            obstacle = _draw_pace(obstacle, anchors, scenario.mission.radius_m, chance)
        obstacles.append(_draw_obstacle(obstacle, vary.obstacles_m, anchors, margin_m, chance))
    ground: dict[str, list[Feature]] = {"potholes": [], "bumps": [], "ditches": []}
    for key, feature in features(world):
        moved = _draw_feature(feature, vary.obstacles_m, anchors, margin_m, Random(f"{seed}/{key}"))
        ground[key.partition("[")[0]].append(moved)
    terrain = {kind: tuple(several) for kind, several in ground.items()}
    drawn = replace(scenario, world=replace(world, obstacles=tuple(obstacles), **terrain, vary=type(vary)()))
    starts: list[Pose2D] = []
    for robot_id, pose in zip(scenario.mission.robots, starts_of(scenario), strict=True):
        starts.append(
            _draw_start(drawn, pose, vary.starts_m, vary.starts_rad, starts, Random(f"{seed}/start{robot_id}"))
        )
    poses = tuple((pose.x, pose.y, pose.theta) for pose in starts)
    return replace(drawn, world=replace(drawn.world, starts=poses))


def _draw_walks(obstacles: tuple[Obstacle, ...], seed: int) -> tuple[Obstacle, ...]:
    """Draw the seeds of random walks, also in a scenario that varies nothing."""
    return tuple(
        obstacle
        if obstacle.walk_m is None
        else replace(obstacle, walk_seed=Random(f"{seed}/walk{n}").getrandbits(WALK_SEED_BITS))
        for n, obstacle in enumerate(obstacles)
    )


def _draw_pace(obstacle: Obstacle, anchors: list[Point], radius_m: float, chance: Random) -> Obstacle:
    """Draw a moving obstacle's speed and initial phase, clear of a robot of `radius_m` at each of `anchors`."""
    if obstacle.velocity_mps is not None:
        (vx, vy), faster = obstacle.velocity_mps, chance.uniform(0.8, 1.2)
        paced = replace(obstacle, velocity_mps=(faster * vx, faster * vy))
        return paced if SPEED_MPS_MIN <= hypot(faster * vx, faster * vy) <= SPEED_MPS_MAX else obstacle
    if not obstacle.waypoints_m:
        return obstacle
    speed_mps = obstacle.speed_mps * chance.uniform(0.8, 1.2)
    obstacle = replace(obstacle, speed_mps=max(SPEED_MPS_MIN, min(SPEED_MPS_MAX, speed_mps)))
    for _ in range(DRAWS_MAX):
        moved = replace(obstacle, phase=chance.random())
        if all(gap_to(anchor, as_it_begins(moved)) >= radius_m for anchor in anchors):
            return moved
    return obstacle


def _draw_obstacle(
    obstacle: Obstacle, within_m: float, anchors: list[Point], margin_m: float, chance: Random
) -> Obstacle:
    if within_m == 0.0:
        return obstacle
    for _ in range(DRAWS_MAX):
        dx, dy = _in_disc(within_m, chance)
        moved = replace(
            obstacle,
            center_m=(obstacle.center_m[0] + dx, obstacle.center_m[1] + dy),
            waypoints_m=tuple((x + dx, y + dy) for x, y in obstacle.waypoints_m),
        )
        if all(_swept_gap(anchor, moved) >= margin_m for anchor in anchors):
            return moved
    return obstacle


def _draw_feature(feature: Feature, within_m: float, anchors: list[Point], margin_m: float, chance: Random) -> Feature:
    if within_m == 0.0:
        return feature
    for _ in range(DRAWS_MAX):
        dx, dy = _in_disc(within_m, chance)
        moved: Feature
        if isinstance(feature, Ditch):
            (x1, y1), (x2, y2) = feature.ends_m
            moved = replace(feature, ends_m=((x1 + dx, y1 + dy), (x2 + dx, y2 + dy)))
        else:
            moved = replace(feature, center_m=(feature.center_m[0] + dx, feature.center_m[1] + dy))
        if all(patch_of(moved).gap_m(*anchor) >= margin_m for anchor in anchors):
            return moved
    return feature


def _draw_start(
    scenario: Scenario, pose: Pose2D, within_m: float, within_rad: float, placed: list[Pose2D], chance: Random
) -> Pose2D:
    radius_m, patches = scenario.mission.radius_m, patches_of(scenario.world)
    obstacles = [as_it_begins(obstacle) for obstacle in scenario.world.obstacles]
    for _ in range(DRAWS_MAX):
        dx, dy = _in_disc(within_m, chance)
        drawn = Pose2D(pose.x + dx, pose.y + dy, pose.theta + chance.uniform(-within_rad, within_rad))
        free = all(hypot(drawn.x - other.x, drawn.y - other.y) > 2.0 * radius_m for other in placed)
        free = free and all(patch.gap_m(drawn.x, drawn.y) > radius_m for patch in patches)
        free = free and all(gap_to((drawn.x, drawn.y), obstacle) > radius_m for obstacle in obstacles)
        if free and all(to_segment((drawn.x, drawn.y), w[:2], w[2:]) > radius_m for w in scenario.world.walls_m):
            return drawn
    return pose


def _in_disc(radius_m: float, chance: Random) -> Point:
    r, angle = radius_m * sqrt(chance.random()), TAU * chance.random()
    return r * cos(angle), r * sin(angle)


def gap_to(place: Point, obstacle: Obstacle) -> float:
    """Return the distance [m] from `place` to the surface of `obstacle` at `center_m`; negative or zero inside."""
    x, y = place[0] - obstacle.center_m[0], place[1] - obstacle.center_m[1]
    if obstacle.radius_m is not None:
        return hypot(x, y) - obstacle.radius_m
    assert obstacle.corners_m is not None, obstacle
    ring = (*obstacle.corners_m, obstacle.corners_m[0])
    inside = all((bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0 for (ax, ay), (bx, by) in pairwise(ring))
    return 0.0 if inside else min(to_segment((x, y), a, b) for a, b in pairwise(ring))


def reach_of(obstacle: Obstacle) -> float:
    """Return the distance [m] of the outermost point from `center_m`."""
    if obstacle.radius_m is not None:
        return obstacle.radius_m
    return max(hypot(x, y) for x, y in obstacle.corners_m or ())


def _swept_gap(place: Point, obstacle: Obstacle) -> float:
    """Return the least distance [m] from `place` to a moving obstacle over its whole trajectory."""
    if obstacle.walk_m is not None:
        return gap_to(place, obstacle) - obstacle.walk_m
    if not obstacle.waypoints_m:  # one at constant velocity passes once, and late
        return gap_to(place, obstacle)
    legs = pairwise((obstacle.center_m, *obstacle.waypoints_m))
    return min(to_segment(place, a, b) for a, b in legs if a != b) - reach_of(obstacle)


def to_segment(p: Point, a: Point, b: Point) -> float:
    """Return the distance [m] from `p` to the nearest point between `a` and `b`."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    along = ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy)
    along = min(1.0, max(0.0, along))
    return hypot(p[0] - a[0] - along * dx, p[1] - a[1] - along * dy)
