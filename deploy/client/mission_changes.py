"""Changes of a running team's mission that an operator may order (E32): another goal or route, or none. Pure."""

from __future__ import annotations

from math import cos, dist, hypot, isfinite, radians, sin

from msgspec import structs

from lfa.deploy.client.order_call import Change
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Mission
from lfa.protocol.mission_checks import check_mission
from lfa.world.description.reachability import parted

APPROACH_M = 0.8
"""Distance [m] before a goal from which a team drives straight at it, in the heading that it is to have there."""

REACH_M = 1000.0
"""Distance [m] from every way-point of the mission beyond which a goal is a mistake: open ground has no other edge."""

Points = tuple[tuple[float, float], ...]
Walls = tuple[tuple[float, float, float, float], ...]


def unchanged(mission: Mission, _first: Mission) -> Mission:
    """Change nothing: for a pause, and for its end."""
    return mission


def along(points: Points, walls: Walls) -> Change:
    """Return the change to a route through `points` [m]. It raises Refused for one behind a wall, or too far away.

    Each point is in reach of the mission's way-points, as it began or as it holds, or of the points before.
    """

    def change(mission: Mission, first: Mission) -> Mission:
        motion = "path_following" if mission.leading.motion == "trajectory" else mission.leading.motion
        leading = structs.replace(mission.leading, route_m=points, motion=motion, times_s=(), orientations=())
        changed = check_mission(structs.replace(mission, leading=leading))
        near = {*mission.leading.route_m, *first.leading.route_m}
        for point in points:
            least_m = min((dist(point, other) for other in near), default=0.0)
            if least_m > REACH_M:
                where = f"{least_m:.0f} m from all way-points"
                raise Refused(f"goal ({point[0]:g}, {point[1]:g}): {where}, must be at most {REACH_M:g} m from one")
            near.add(point)
        for point in points:
            if any(_distance(point, wall) < mission.radius_m for wall in walls):
                right = f"must be {mission.radius_m:g} m clear of it"
                raise Refused(f"goal ({point[0]:g}, {point[1]:g}): in a wall, {right}")
        missed = parted((mission.leading.route_m[0], *points), walls, mission.radius_m)
        if missed is not None:
            x, y = missed
            raise Refused(f"goal ({x:g}, {y:g}): outside of the map or walled off, must be reachable from the route")
        return changed

    return change


def to_goal(x: float, y: float, theta_deg: float | None) -> Points:
    """Return the way-points to a goal [m, degrees]. Raises Refused for numbers that are none."""
    if not all(map(isfinite, (x, y))):
        raise Refused(f"goal ({x:g}, {y:g}): must be finite numbers [m]")
    if not isfinite(theta_deg or 0.0):
        raise Refused(f"goal ({x:g}, {y:g}), heading {theta_deg:g}: must be a finite number [degrees]")
    if theta_deg is None:
        return ((x, y),)
    theta = radians(theta_deg)
    return ((x - APPROACH_M * cos(theta), y - APPROACH_M * sin(theta)), (x, y))


def _distance(point: tuple[float, float], wall: tuple[float, float, float, float]) -> float:
    (px, py), (x1, y1, x2, y2) = point, wall
    dx, dy = x2 - x1, y2 - y1
    length = dx * dx + dy * dy
    share = 0.0 if length == 0.0 else min(1.0, max(0.0, ((px - x1) * dx + (py - y1) * dy) / length))
    return hypot(px - x1 - share * dx, py - y1 - share * dy)
