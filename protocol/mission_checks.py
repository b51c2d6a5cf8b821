"""Checks of a `Mission`: each finds mistakes with the field, its value and what would be right."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import hypot, inf, isfinite, pi

from lfa.protocol.config_file.mistake import Mistake, Range, RefusedValue, Rule, apply_rules, out_of_range, wrong
from lfa.protocol.geometry import Point, convex
from lfa.protocol.mission import (
    CONTROL_HZ,
    CONTROL_HZ_MIN,
    FOOTPRINT_CORNERS_MAX,
    KNOWN_MAX,
    ROUTE_M_MAX,
    Leading,
    Mission,
)

REACH_M = 1e-3
"""Distance [m] by which the corners of a body may lie outside of its circle: a radius is written with few digits."""
_ROBOTS, _ROUTE, _TIMES = "mission.robots", "mission.leading.route_m", "mission.leading.times_s"


def check_mission(mission: Mission) -> Mission:
    """Return `mission`. Raises RefusedValue for the first infeasible field."""
    mistakes: list[Mistake] = []
    apply_rules(MISSION_RULES, mission, mistakes)
    if mistakes:
        raise RefusedValue(mistakes[0])
    return mission


def _robots(mission: Mission) -> Iterator[Mistake]:
    ids = list(mission.robots)
    repeated = next((i for n, i in enumerate(ids) if i in ids[:n]), None)
    if not ids:
        yield wrong(_ROBOTS, ids, "at least one robot id")
    elif min(ids) < 1:
        yield wrong(_ROBOTS, ids, "ids from 1 upwards")
    elif repeated is not None:
        yield wrong(_ROBOTS, ids, f"each id once (id {repeated} is given twice)")


def _can_lead(mission: Mission) -> Iterator[Mistake]:
    named = mission.can_lead
    if named is not None and not (named and set(named) <= set(mission.robots)):
        yield wrong("mission.can_lead", list(named), "a non-empty part of mission.robots", _ROBOTS)


def _route(mission: Mission) -> Iterator[Mistake]:
    """Find way-points too far apart to keep the path along them in memory."""
    points = mission.leading.route_m
    if not points:
        yield wrong(_ROUTE, "[]", "at least one way-point [x, y]")
    far = [n for n, point in enumerate(points) if not all(isfinite(c) and abs(c) <= ROUTE_M_MAX for c in point)]
    for n in far:
        yield wrong(f"{_ROUTE}[{n}]", list(points[n]), f"coordinates [m] from {-ROUTE_M_MAX:g} to {ROUTE_M_MAX:g}")
    length_m = sum(hypot(q[0] - p[0], q[1] - p[1]) for p, q in pairwise(points))
    if not far and length_m > ROUTE_M_MAX:
        yield wrong(_ROUTE, f"{length_m:.0f} m of way", f"at most {ROUTE_M_MAX:g} m")


def _times(mission: Mission) -> Iterator[Mistake]:
    """Find a trajectory without a time per way-point, or with a leg that needs more than `cruise_mps`."""
    leading = mission.leading
    times, points = leading.times_s, leading.route_m
    if leading.motion != "trajectory":
        if times:
            yield wrong(_TIMES, list(times), 'left out without motion = "trajectory"', "mission.leading.motion")
    elif not len(times) == len(points) >= 2:
        yield wrong(_TIMES, list(times), f"a time for each of the {len(points)} way-points", _ROUTE)
    elif not (all(isfinite(b) and a < b for a, b in pairwise(times)) and times[0] == 0.0):
        yield wrong(_TIMES, list(times), "rising from 0")
    else:
        yield from _hurried(leading)


def _hurried(leading: Leading) -> Iterator[Mistake]:
    legs = zip(pairwise(leading.times_s), pairwise(leading.route_m), strict=True)
    for n, ((a, b), (p, q)) in enumerate(legs, start=1):
        needed_mps = hypot(q[0] - p[0], q[1] - p[1]) / (b - a)
        if needed_mps > leading.cruise_mps:
            right = f"later: this leg needs {needed_mps:.2f} m/s, more than cruise_mps = {leading.cruise_mps:g}"
            yield wrong(f"{_TIMES}[{n}]", b, right, "mission.leading.cruise_mps", _ROUTE)


def _known(mission: Mission) -> Iterator[Mistake]:
    """Find known obstacles that are no circles, or without `path_following`, which alone avoids them."""
    where, circles = "mission.leading.known_m", mission.leading.known_m
    value = [list(circle) for circle in circles]
    if circles and mission.leading.motion != "path_following":
        yield wrong(where, value, 'left out without motion = "path_following"', "mission.leading.motion")
    if len(circles) > KNOWN_MAX:
        yield wrong(where, f"{len(circles)} circles", f"at most {KNOWN_MAX}")
    for n, circle in enumerate(circles):
        if not (all(map(isfinite, circle)) and 0.0 < circle[2] <= 100.0):
            yield wrong(f"{where}[{n}]", value[n], "x, y, radius [m], the radius above 0 and at most 100")


def _boxes(mission: Mission) -> Iterator[Mistake]:
    for n, box in enumerate(mission.leading.keepout_m):
        if not (all(map(isfinite, box)) and box[0] < box[2] and box[1] < box[3]):
            where = f"mission.leading.keepout_m[{n}]"
            yield wrong(where, list(box), "x1, y1, x2, y2 [m] with x1 < x2 and y1 < y2")


def _footprint(mission: Mission) -> Iterator[Mistake]:
    if mission.footprint_m:
        yield from footprint_mistakes("mission.footprint_m", mission.footprint_m, mission.radius_m)


def footprint_mistakes(where: str, corners: Sequence[Point], radius_m: float) -> Iterator[Mistake]:
    """Find a body at key `where` that is not convex, does not hold `base_link`, or is larger than its circle."""
    value = [list(corner) for corner in corners]
    sides = list(zip(corners, (*corners[1:], corners[0]), strict=True))
    if len(corners) > FOOTPRINT_CORNERS_MAX:
        yield wrong(where, f"{len(corners)} corners", f"at most {FOOTPRINT_CORNERS_MAX}")
    elif not (all(isfinite(c) for corner in corners for c in corner) and convex(corners)):
        yield wrong(where, value, "at least three corners of a convex polygon, counter-clockwise")
    elif any(ax * by - ay * bx <= 0.0 for (ax, ay), (bx, by) in sides):
        yield wrong(where, value, "around the origin [0, 0], where base_link is")
    else:
        reach_m = max(hypot(x, y) for x, y in corners)
        if radius_m < reach_m - REACH_M:
            right = f"at least {reach_m:.4g}, the distance of the farthest corner of {where}"
            yield wrong("mission.radius_m", radius_m, right, where)


def _orientations(mission: Mission) -> Iterator[Mistake]:
    for n, orientation in enumerate(mission.leading.orientations):
        if not (isfinite(orientation.at_m) and orientation.at_m >= 0.0):
            yield wrong(f"mission.leading.orientations[{n}].at_m", orientation.at_m, ">= 0, metres along the route")


def _ranges(mission: Mission) -> Iterator[Mistake]:
    formation, limits, leading = mission.formation, mission.limits, mission.leading
    apart_m, a_max = 2.0 * mission.radius_m + 0.1, limits.a_max_mps2
    return out_of_range((
        Range("mission.radius_m", mission.radius_m, 0.01, 5.0),
        Range("mission.control_hz", mission.control_hz, CONTROL_HZ_MIN, CONTROL_HZ),
        Range("mission.formation.separation_m", formation.separation_m, apart_m, 100.0, "mission.radius_m"),
        Range("mission.formation.angle_rad", formation.angle_rad, 0.0, pi / 2),
        Range("mission.formation.heading_filter_m", formation.heading_filter_m, 0.0, 100.0),
        Range("mission.operator_timeout_s", mission.operator_timeout_s or 1.0, 0.5, 3600.0),
        Range("mission.continue_after_s", mission.continue_after_s, 2.0, 3600.0),
        Range("mission.following.delay_s", mission.following.delay_s or 0.0, 0.0, 0.8),
        Range("mission.limits.v_max_mps", limits.v_max_mps, 0.01, inf),
        Range("mission.limits.v_reverse_max_mps", limits.v_reverse_max_mps, 0.0, inf),
        Range("mission.limits.omega_max_radps", limits.omega_max_radps, 0.01, inf),
        Range("mission.limits.a_max_mps2", limits.a_max_mps2, 0.01, inf),
        Range("mission.limits.alpha_max_radps2", limits.alpha_max_radps2, 0.01, inf),
        Range("mission.limits.bridge_gap_m", limits.bridge_gap_m, 0.0, 10.0),
        Range("mission.limits.climb_step_m", limits.climb_step_m, 0.0, 10.0),
        Range("mission.leading.cruise_mps", leading.cruise_mps, 0.01, limits.v_max_mps, "mission.limits.v_max_mps"),
        Range("mission.leading.acceleration_mps2", leading.acceleration_mps2, 0.01, a_max, "mission.limits.a_max_mps2"),
        Range("mission.leading.goal_tolerance_m", leading.goal_tolerance_m, 0.01, 10.0),
        Range("mission.leading.waypoint_tolerance_m", leading.waypoint_tolerance_m, 0.02, 10.0),
        Range("mission.leading.corner_radius_m", leading.corner_radius_m or 0.0, 0.0, 100.0),
    ))  # fmt: skip


MISSION_RULES: tuple[Rule[Mission], ...] = tuple(
    Rule(check) for check in (_robots, _can_lead, _ranges, _route, _times, _known, _boxes, _orientations, _footprint)
)
