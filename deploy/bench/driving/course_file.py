"""Scenario file of a course: a team in the open or between walls, with the noise of the shipped scenario `explore`."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import Struct

Point = tuple[float, float]
Segment = tuple[float, float, float, float]

CRUISE_MPS = 0.4
NOISE = """
[world.noise]
localization_m = 0.005
localization_rad = 0.0087
odometry = 0.01
range_m = 0.005
range_dropout = 0.002
"""


class Course(Struct, frozen=True):
    """Ground between a route's points [m], what stands or moves on it, and the time [s] that a team may take."""

    route_m: tuple[Point, ...]
    walls_m: tuple[Segment, ...] = ()
    obstacles: tuple[str, ...] = ()
    """Obstacles, each as an inline table of TOML."""
    time_limit_s: float = 240.0


def course_text(title: str, course: Course, motion: str, robots: int = 4, sets: Sequence[str] = ()) -> str:
    """Return the scenario file of a team of `robots` in a column; `sets` are lines of the table `[mission]`."""
    points = course.route_m if motion in ("path_following", "reactive") else course.route_m[-1:]
    route = ", ".join(f"[{x:g}, {y:g}]" for x, y in points)
    walls = ", ".join(f"[{', '.join(f'{value:g}' for value in wall)}]" for wall in course.walls_m)
    trace = "[mission.following]\ntrace = true\n" if motion == "explore" else ""
    return f"""title = "{title}"
time_limit_s = {course.time_limit_s:g}
[mission]
cold_start = "majority"
robots = {list(range(1, robots + 1))}
{chr(10).join(sets)}
[mission.formation]
separation_m = 1.0
angle_rad = 1.0471975511965976
side = "column"
heading_filter_m = 0.6
{trace}[mission.leading]
motion = "{motion}"
route_m = [{route}]
cruise_mps = {CRUISE_MPS:g}
[world]
walls_m = [{walls}]
obstacles = [{", ".join(course.obstacles)}]
{NOISE}"""
