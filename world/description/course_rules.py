"""The rule that starts and goal are free, and that the goal can be reached."""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot

from lfa.protocol.config_file.mistake import Mistake, Rule, wrong
from lfa.protocol.geometry import Pose2D
from lfa.world.description.placement import as_it_begins, gap_to, starts_of, to_segment, with_spares
from lfa.world.description.reachability import parted
from lfa.world.description.scenario import Point, Scenario
from lfa.world.description.terrain import features, patch_of


def _course(scenario: Scenario) -> Iterator[Mistake]:
    yield from _starts(scenario)
    yield from _goal(scenario)


def _starts(scenario: Scenario) -> Iterator[Mistake]:
    mission, starts = scenario.mission, scenario.world.starts
    if starts is not None and len(starts) != len(mission.robots):
        yield wrong("world.starts", f"{len(starts)} poses", f"one pose for each of the {len(mission.robots)} robots")
        return
    scenario = with_spares(scenario)
    poses = starts_of(scenario)
    for robot_id, pose in zip(scenario.mission.robots, poses, strict=True):
        place = f"the start of robot {robot_id} at ({pose.x:.2f}, {pose.y:.2f})"
        yield from _covered(scenario, (pose.x, pose.y), place)
    if not scenario.world.starts_coincide:
        yield from _overlapping(scenario, poses)


def _overlapping(scenario: Scenario, poses: tuple[Pose2D, ...]) -> Iterator[Mistake]:
    robots, apart_m = scenario.mission.robots, 2.0 * scenario.mission.radius_m
    for n, (robot_id, pose) in enumerate(zip(robots, poses, strict=True)):
        for other_id, other in zip(robots[:n], poses[:n], strict=True):
            if hypot(pose.x - other.x, pose.y - other.y) < apart_m:
                value = f"robots {other_id} and {robot_id} both near ({pose.x:.2f}, {pose.y:.2f})"
                yield wrong("world.starts", value, f"starts at least {apart_m:g} m apart (two radii)")


def _goal(scenario: Scenario) -> Iterator[Mistake]:
    mission, route = scenario.mission, scenario.mission.leading.route_m
    goal, first = mission.goal_m, starts_of(scenario)[0]
    start = f"the start of robot {mission.robots[0]} at ({first.x:.2f}, {first.y:.2f})"
    value = f"... [{goal[0]:g}, {goal[1]:g}]"
    yield from _covered(scenario, goal, f"the goal at ({goal[0]:.2f}, {goal[1]:.2f})")
    missed = None
    if not any(_in_wall(scenario, place) for place in ((first.x, first.y), goal)):  # of which a line is said already
        missed = parted(((first.x, first.y), *route), scenario.world.walls_m, mission.half_width_m)
    if missed == goal:
        yield wrong("mission.leading.route_m", value, f"a goal that can be reached, walls part it from {start}")
    elif missed is not None:
        where = f"mission.leading.route_m[{route.index(missed)}]"
        yield wrong(where, list(missed), f"a way-point that can be reached, walls part it from {start}")
    for n, box in enumerate(mission.leading.keepout_m):
        if _within(goal, box):
            yield wrong("mission.leading.route_m", value, f"a goal outside of the keep-out box {list(box)}")
        if _within((first.x, first.y), box):
            yield wrong(f"mission.leading.keepout_m[{n}]", list(box), f"clear of {start}")


def _within(place: Point, box: tuple[float, float, float, float]) -> bool:
    return box[0] <= place[0] <= box[2] and box[1] <= place[1] <= box[3]


def _covered(scenario: Scenario, place: Point, whose: str) -> Iterator[Mistake]:
    """Find obstacles, terrain and walls on a place that must be free."""
    radius_m, right = scenario.mission.radius_m, f"clear of {whose}"
    for n, obstacle in enumerate(scenario.world.obstacles):
        begins = as_it_begins(obstacle)
        if gap_to(place, begins) < radius_m:
            yield wrong(f"world.obstacles[{n}]", f"at {list(begins.center_m)}", right)
    for key, feature in features(scenario.world):
        patch = patch_of(feature)
        if patch.gap_m(*place) < radius_m:
            yield wrong(f"world.{key}", f"at {[patch.x, patch.y]}", right)
    for n, wall in enumerate(scenario.world.walls_m):
        if to_segment(place, wall[:2], wall[2:]) < radius_m:
            yield wrong(f"world.walls_m[{n}]", list(wall), right)


def _in_wall(scenario: Scenario, place: Point) -> bool:
    radius_m = scenario.mission.radius_m
    return any(to_segment(place, wall[:2], wall[2:]) < radius_m for wall in scenario.world.walls_m)


PLACES = (
    "mission.robots", "mission.formation", "mission.radius_m", "mission.leading", "world.starts", "world.start",
    "world.spares", "world.map", "world.keepout", "world.obstacles", "world.potholes", "world.bumps", "world.ditches",
    "world.walls_m",
)  # fmt: skip
"""Keys from which it follows where robots, obstacles and the goal are."""
COURSE_RULE: Rule[Scenario] = Rule(_course, PLACES)
