"""Checks of a `Mission`; each raises `Refused` with the field, its value and what would be right."""

from __future__ import annotations

from itertools import pairwise
from math import hypot, inf, isfinite, pi

from lfa.protocol.errors import Refused
from lfa.protocol.mission import KNOWN_MAX, ROUTE_M_MAX, Leading, Mission


def check_mission(mission: Mission) -> Mission:
    """Return `mission`. Raises Refused for the first infeasible field."""
    ids = mission.robots
    repeated = next((i for n, i in enumerate(ids) if i in ids[:n]), None)
    _require(len(ids) >= 1, "mission.robots", list(ids), "at least one robot id")
    _require(all(i >= 1 for i in ids), "mission.robots", list(ids), "ids from 1 upwards")
    _require(repeated is None, "mission.robots", list(ids), f"each id once (id {repeated} is given twice)")
    if mission.can_lead is not None:
        known = [i for i in mission.can_lead if i in ids]
        right = "a non-empty part of mission.robots"
        _require(bool(known) and len(known) == len(mission.can_lead), "mission.can_lead", mission.can_lead, right)
    for name, value, low, high in _ranges(mission):
        fine = isfinite(value) and low <= value <= high
        _require(
            fine,
            f"mission.{name}",
            value,
            f"a number from {low:g} to {high:g}" if high < inf else f">= {low:g}",
        )
    _require(len(mission.leading.route_m) >= 1, "mission.leading.route_m", "[]", "at least one way-point [x, y]")
    _check_times(mission.leading)
    _check_known(mission.leading)
    for box in mission.leading.keepout_m:
        fine = all(map(isfinite, box)) and box[0] < box[2] and box[1] < box[3]
        _require(fine, "mission.leading.keepout_m", list(box), "x1, y1, x2, y2 [m] with x1 < x2 and y1 < y2")
    for orientation in mission.leading.orientations:
        fine = isfinite(orientation.at_m) and orientation.at_m >= 0.0
        _require(fine, "mission.leading.orientations.at_m", orientation.at_m, ">= 0, metres along the route")
    _check_route(mission.leading.route_m)
    return mission


def _check_route(points: tuple[tuple[float, float], ...]) -> None:
    """Raise Refused for way-points too far apart to keep the path along them in memory."""
    where = "mission.leading.route_m"
    for point in points:
        near = all(isfinite(c) and abs(c) <= ROUTE_M_MAX for c in point)
        _require(near, where, list(point), f"coordinates [m] from {-ROUTE_M_MAX:g} to {ROUTE_M_MAX:g}")
    length_m = sum(hypot(q[0] - p[0], q[1] - p[1]) for p, q in pairwise(points))
    _require(length_m <= ROUTE_M_MAX, where, f"{length_m:.0f} m of way", f"at most {ROUTE_M_MAX:g} m")


def _check_known(leading: Leading) -> None:
    """Raise Refused for known obstacles that are no circles, or without `path_following`, which alone avoids them."""
    where, followed = "mission.leading.known_m", leading.motion == "path_following"
    value = [list(circle) for circle in leading.known_m]
    _require(followed or not value, where, value, 'left out without motion = "path_following"')
    _require(len(value) <= KNOWN_MAX, where, f"{len(value)} circles", f"at most {KNOWN_MAX}")
    for circle in leading.known_m:
        fine = all(map(isfinite, circle)) and 0.0 < circle[2] <= 100.0
        _require(fine, where, list(circle), "x, y, radius [m], the radius above 0 and at most 100")


def _check_times(leading: Leading) -> None:
    """Raise Refused for a trajectory without a time per way-point, or with a leg that needs more than `cruise_mps`."""
    times, points, where = leading.times_s, leading.route_m, "mission.leading.times_s"
    if leading.motion != "trajectory":
        _require(not times, where, list(times), 'left out without motion = "trajectory"')
        return
    _require(len(times) == len(points) >= 2, where, list(times), f"a time for each of the {len(points)} way-points")
    rising = all(isfinite(b) and a < b for a, b in pairwise(times)) and times[0] == 0.0
    _require(rising, where, list(times), "rising from 0")
    for (a, b), (p, q) in zip(pairwise(times), pairwise(points), strict=True):
        needed_mps = hypot(q[0] - p[0], q[1] - p[1]) / (b - a)
        right = f"later: this leg needs {needed_mps:.2f} m/s, more than cruise_mps = {leading.cruise_mps:g}"
        _require(needed_mps <= leading.cruise_mps, where, b, right)


def _ranges(mission: Mission) -> list[tuple[str, float, float, float]]:
    formation, limits, leading = mission.formation, mission.limits, mission.leading
    return [
        ("radius_m", mission.radius_m, 0.01, 5.0),
        ("formation.separation_m", formation.separation_m, 2.0 * mission.radius_m + 0.1, 100.0),
        ("formation.angle_rad", formation.angle_rad, 0.0, pi / 2),
        ("formation.heading_filter_m", formation.heading_filter_m, 0.0, 100.0),
        ("continue_after_s", mission.continue_after_s, 2.0, 3600.0),
        ("following.delay_s", mission.following.delay_s or 0.0, 0.0, 0.8),
        ("limits.v_max_mps", limits.v_max_mps, 0.01, inf),
        ("limits.v_reverse_max_mps", limits.v_reverse_max_mps, 0.0, inf),
        ("limits.omega_max_radps", limits.omega_max_radps, 0.01, inf),
        ("limits.a_max_mps2", limits.a_max_mps2, 0.01, inf),
        ("limits.alpha_max_radps2", limits.alpha_max_radps2, 0.01, inf),
        ("limits.bridge_gap_m", limits.bridge_gap_m, 0.0, 10.0),
        ("limits.climb_step_m", limits.climb_step_m, 0.0, 10.0),
        ("leading.cruise_mps", leading.cruise_mps, 0.01, limits.v_max_mps),
        ("leading.acceleration_mps2", leading.acceleration_mps2, 0.01, limits.a_max_mps2),
        ("leading.goal_tolerance_m", leading.goal_tolerance_m, 0.01, 10.0),
    ]


def _require(fine: bool, where: str, value: object, right: str) -> None:
    if not fine:
        raise Refused(f"{where} = {value}: must be {right}")
