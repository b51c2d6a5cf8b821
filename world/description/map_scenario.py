"""Scenarios on a ROS map: walls, keepout boxes, and a placement of the chain at the start."""

from __future__ import annotations

from math import atan2, ceil, cos, hypot, inf, pi, sin
from pathlib import Path

from msgspec.structs import replace

from lfa.protocol.config_file.mistake import Mistake, RefusedValue
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import TAU, Pose2D, wrap
from lfa.protocol.mission import Mission
from lfa.world.description import maps
from lfa.world.description.maps import Map, Room
from lfa.world.description.placement import slot_bearing
from lfa.world.description.scenario import Scenario

MARGIN_M = 0.10
"""Clearance [m] between a robot's hull and walls when the chain is laid out."""
BEND_STEP_RAD = pi / 18
HEADINGS = 24
LINE_STEP_M = 0.05
LAY_OUT_TRIES_MAX = 20_000


def on_map(scenario: Scenario, folder: Path) -> Scenario:
    """Return `scenario` with walls, keepout boxes and starts computed from its maps; the result refers to no map.

    Paths are relative to `folder`. Raises RefusedValue for a map that cannot be read, or a start or goal without room.
    """
    world, mission = scenario.world, scenario.mission
    if world.start is not None and len(world.start) not in (2, 3):
        raise _refused("world.start", list(world.start), "must be [x, y] or [x, y, theta]")
    if world.start is not None and world.starts is not None:
        right = "must be left out where world.starts says it of every robot"
        raise _refused("world.start", list(world.start), right)
    if world.keepout is not None:
        leading = replace(mission.leading, keepout_m=_keepout(folder / world.keepout))
        mission = replace(mission, leading=leading)
    room = None
    if world.map is not None:
        drawn = _read("world.map", folder / world.map)
        world, room = replace(world, walls_m=(*world.walls_m, *maps.walls(drawn))), Room(drawn)
        _check_goal(scenario, drawn, room)
        _check_start(scenario, drawn)
    if world.starts is None:
        starts = _starts(scenario, room)
        world = replace(world, starts=tuple((pose.x, pose.y, pose.theta) for pose in starts) if starts else None)
    return replace(scenario, mission=mission, world=replace(world, map=None, keepout=None, start=None))


def _refused(key: str, value: object, says: str) -> RefusedValue:
    return RefusedValue(Mistake(key, f" = {value}: {says}"))


def _keepout(path: Path) -> tuple[tuple[float, float, float, float], ...]:
    mask = _read("world.keepout", path)
    if mask.origin[2] != 0.0:
        raise _refused("world.keepout", path.name, f"origin = {list(mask.origin)}: must have yaw 0 in a keepout mask")
    return maps.boxes(mask)


def _read(key: str, path: Path) -> Map:
    try:
        return maps.read(path)
    except Refused as refused:
        raise _refused(key, path.name, str(refused)) from None


def _check_goal(scenario: Scenario, drawn: Map, room: Room) -> None:
    if not scenario.mission.leading.route_m:
        return
    (x, y), radius_m = scenario.mission.goal_m, scenario.mission.radius_m
    key, value = "mission.leading.route_m", f"... [{x:g}, {y:g}]"
    cell = drawn.cell_of(x, y)
    if cell is None:
        raise _refused(key, value, f"the goal is outside of the map {scenario.world.map}: must be within it")
    if drawn.occupied[cell]:
        raise _refused(key, value, f"the goal is inside a wall of the map {scenario.world.map}: must be on free ground")
    if room.clearance_m(x, y) < radius_m:
        what = f"the goal is {room.clearance_m(x, y):.2f} m from the walls of {scenario.world.map}"
        raise _refused(key, value, f"{what}: must be {radius_m:g} m (the robots' radius) clear of them")


def _check_start(scenario: Scenario, drawn: Map) -> None:
    """Raise RefusedValue for a given start outside the map or inside a wall; distance to walls is checked elsewhere."""
    world = scenario.world
    given = {"world.start": world.start or (0.0, 0.0)}
    if world.starts is not None:
        given = {f"world.starts[{n}]": start for n, start in enumerate(world.starts)}
    for key, (x, y, *_) in given.items():
        cell = drawn.cell_of(x, y)
        if cell is None:
            raise _refused(key, [x, y], f"outside of the map {world.map}: must be within it")
        if drawn.occupied[cell]:
            raise _refused(key, [x, y], f"inside a wall of the map {world.map}: must have room for a robot")


def _starts(scenario: Scenario, room: Room | None) -> list[Pose2D] | None:
    """Place the first robot at `start` and each other in its slot, bending the chain least where walls need it.

    Return None without a map and a start. Raises RefusedValue when there is no room.
    """
    start, mission = scenario.world.start, scenario.mission
    if start is None and room is None:
        return None
    x, y = (start[0], start[1]) if start is not None else (0.0, 0.0)
    if room is not None and room.clearance_m(x, y) < mission.radius_m:
        what = f"{room.clearance_m(x, y):.2f} m from a wall"
        raise _refused("world.start", [x, y], f"{what} of the map {scenario.world.map}: must have room for a robot")
    if (start is not None and len(start) == 3) or not mission.leading.route_m:
        headings = [start[2] if start is not None and len(start) == 3 else 0.0]
    else:
        towards = atan2(mission.goal_m[1] - y, mission.goal_m[0] - x)
        headings = [wrap(towards + n * TAU / HEADINGS) for n in _outwards(HEADINGS // 2)]
    found = [laid for laid in (_lay_out(mission, Pose2D(x, y, theta), room) for theta in headings) if laid is not None]
    if not found:
        right = f"must have room behind it for {len(mission.robots)} robots, {mission.formation.separation_m:g} m apart"
        raise _refused("world.start", [round(x, 2), round(y, 2)], right)
    return min(found, key=lambda laid: (laid[0], abs(wrap(laid[1][0].theta - headings[0]))))[1]


def _lay_out(mission: Mission, first: Pose2D, room: Room | None) -> tuple[float, list[Pose2D]] | None:
    """Search depth first, straightest first; return the chain's total bend [rad] and its poses, or None."""
    tries = 0

    def after(poses: list[Pose2D], bent: float) -> tuple[float, list[Pose2D]] | None:
        nonlocal tries
        hop = len(poses) - 1
        if hop == len(mission.robots) - 1:
            return bent, poses
        for n in _outwards(9):
            tries += 1
            if tries > LAY_OUT_TRIES_MAX:
                return None
            pose = _behind(poses[-1], slot_bearing(mission, hop), n * BEND_STEP_RAD, mission.formation.separation_m)
            if _stands(mission, poses, pose, room):
                done = after([*poses, pose], bent + abs(n) * BEND_STEP_RAD)
                if done is not None:
                    return done
        return None

    return after([first], 0.0)


def _behind(ahead: Pose2D, phi: float, bend: float, separation_m: float) -> Pose2D:
    angle = ahead.theta + phi + bend
    return Pose2D(ahead.x + separation_m * cos(angle), ahead.y + separation_m * sin(angle), wrap(ahead.theta + bend))


def _stands(mission: Mission, others: list[Pose2D], pose: Pose2D, room: Room | None) -> bool:
    """Return True if `pose` and the segment to the predecessor are clear of walls, and no other robot is near."""
    apart = min(hypot(pose.x - other.x, pose.y - other.y) for other in others)
    if apart < 0.9 * mission.formation.separation_m:
        return False
    if room is None:
        return True
    ahead = others[-1]
    steps = max(1, ceil(hypot(ahead.x - pose.x, ahead.y - pose.y) / LINE_STEP_M))
    line = ((pose.x + (ahead.x - pose.x) * n / steps, pose.y + (ahead.y - pose.y) * n / steps) for n in range(steps))
    return min((room.clearance_m(*point) for point in line), default=inf) >= mission.radius_m + MARGIN_M


def _outwards(most: int) -> list[int]:
    """Return 0, 1, -1, 2, -2 ... up to `most` on either side."""
    return [0, *(side * n for n in range(1, most + 1) for side in (1, -1))]
