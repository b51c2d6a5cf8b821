"""A scanner with a field of view, anywhere on a robot of any shape: its scans are those of `base_link`."""

from __future__ import annotations

from math import cos, hypot, inf, isfinite, isnan, nan, pi, sin

import pytest

from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D
from lfa.world.description.load import load
from lfa.world.description.scenario import Scenario
from lfa.world.sensors.lidar import Scanner
from lfa.world.sensors.lidar_mount import BaseScan, seen_from_base

BEAMS = 360
WALLS = "world.walls_m=[[3,-1,3,1],[-2,-1,-2,1]]"
JACKAL = (
    "mission.radius_m=0.333",
    "world.body.footprint_m=[[0.254,0.215],[-0.254,0.215],[-0.254,-0.215],[0.254,-0.215]]",
)
WIDE = "mission.formation.separation_m=1.5"


def scene(*overrides: str) -> Scenario:
    route = "mission.leading.route_m=[[1.0, 0.0]]"
    return load("straight", ["mission.robots=[1]", f"world.lidar.beams={BEAMS}", route, *overrides])


def seen(scenario: Scenario, *poses: Pose2D) -> BaseScan:
    """What the first robot's scanner sees, without noise."""
    ranges = Scanner(scenario).scan(poses or (Pose2D(),), {})[0]
    return seen_from_base(ranges.tolist(), scenario.world.lidar)


def points(scan: BaseScan) -> list[tuple[float, float]]:
    angles = ((scan.angle_min + n * scan.step, reading) for n, reading in enumerate(scan.ranges_m))
    return [(reading * cos(angle), reading * sin(angle)) for angle, reading in angles if isfinite(reading)]


def test_at_the_centre_with_a_full_turn_nothing_is_moved() -> None:
    scan = seen(scene(WALLS))
    assert (scan.angle_min, len(scan.ranges_m), scan.range_max_m) == (-pi, BEAMS, 8.0)
    assert min(scan.ranges_m) == pytest.approx(2.0)


def test_what_is_behind_a_narrow_field_of_view_is_not_seen() -> None:
    scan = seen(scene(WALLS, f"world.lidar.fov_rad={1.5 * pi}", "world.lidar.beams=270"))
    assert len(scan.ranges_m) == 270 and scan.angle_min == pytest.approx(-0.75 * pi)
    assert min(scan.ranges_m) == pytest.approx(3.0)
    assert all(x > 0.0 for x, _ in points(scan))


def test_a_scanner_that_looks_back_sees_what_is_behind() -> None:
    scan = seen(scene(WALLS, f"world.lidar.fov_rad={pi}", "world.lidar.beams=180", f"world.lidar.mount=[0,0,{pi}]"))
    assert points(scan) and all(abs(x + 2.0) < 1e-6 for x, _ in points(scan))


@pytest.mark.parametrize("mount", ["[0.1,0.0,0.0]", "[-0.05,0.1,0.7]"])
def test_walls_stand_where_they_are_wherever_the_scanner_is(mount: str) -> None:
    scan = seen(scene(WALLS, f"world.lidar.mount={mount}"))
    assert {round(x) for x, _ in points(scan)} == {3, -2}
    assert all(min(abs(x - 3.0), abs(x + 2.0)) < 0.02 for x, _ in points(scan)), "half a beam of bearing"


def test_directions_without_a_reading_are_bad_beams_and_free_ones_stay_free() -> None:
    lidar = scene("world.lidar.mount=[0.1,0,0]").world.lidar
    scan = seen_from_base([inf] * BEAMS, lidar)
    assert sum(reading == inf for reading in scan.ranges_m) == BEAMS
    assert all(isnan(reading) or reading == inf for reading in scan.ranges_m)
    assert all(map(isnan, seen_from_base([nan] * BEAMS, lidar).ranges_m))


def test_a_rectangle_is_seen_as_one_and_not_by_itself() -> None:
    scenario = scene(*JACKAL, WIDE)
    scan = seen(scenario, Pose2D(), Pose2D(2.0, 0.0, 0.0))
    assert min(scan.ranges_m) == pytest.approx(2.0 - 0.254)
    turned = seen(scenario, Pose2D(), Pose2D(2.0, 0.0, pi / 2))
    assert min(turned.ranges_m) == pytest.approx(2.0 - 0.215)
    assert all(hypot(x, y) > 1.0 for x, y in points(scan)), "its own body is no obstacle"


def test_a_scanner_at_the_nose_sees_a_mate_right_before_it() -> None:
    scan = seen(scene(*JACKAL, WIDE, "world.lidar.mount=[0.25,0,0]"), Pose2D(), Pose2D(0.70, 0.0, 0.0))
    assert min(scan.ranges_m) == pytest.approx(0.70 - 0.254, abs=1e-3)


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("world.lidar.beams=3", "world.lidar.beams = 3"),
        ("world.lidar.beams=-1", "world.lidar.beams = -1"),
        ("world.lidar.fov_rad=7", "world.lidar.fov_rad = 7"),
        ("world.lidar.mount=[0.5,0,0]", "world.lidar.mount = [0.5, 0.0, 0.0]"),
        ("world.lidar.mount=[nan,0,0]", "world.lidar.mount"),
    ],
)
def test_a_scanner_that_cannot_be_is_refused_in_one_line(override: str, says: str) -> None:
    with pytest.raises(Refused) as refused:
        scene(override)
    assert says in str(refused.value) and "\n" not in str(refused.value)
