"""From the ground profile to potholes, bumps and ditches: crossed, or barred."""

from math import inf, nan

import pytest

from lfa.agents.avoidance.ground_crossing import BESIDE_M, CROSSING_MPS, LATE_S, GroundCrossing
from lfa.agents.avoidance.safety import safe
from lfa.agents.perception.ground_map import SEEN_MIN, GroundMap
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import GroundProfile
from lfa.protocol.mission import Limits

HEADER = Header("world", 1, 0, 0.0)
LIMITS = Limits()
POINTS = 29
STEP = 0.05


def profile(
    *features: tuple[float, float, float], lines: tuple[int, ...] = (0, 1, 2), shift: float = 0.0
) -> GroundProfile:
    """Features as (from, to, height) on `lines`; each further line begins `shift` later."""
    rows = []
    for line in range(3):
        row = []
        for n in range(POINTS):
            x = 0.1 + n * STEP
            hits = [h for a, b, h in features if line in lines and a + shift * (line == 1) <= x < b]
            row.append(hits[0] if hits else 0.0)
        rows.append(tuple(row))
    return GroundProfile(HEADER, 0.1, STEP, (0.12, 0.0, -0.12), tuple(rows))


def looked_at(seen: GroundProfile, times: int = SEEN_MIN) -> GroundMap:
    ground = GroundMap(LIMITS)
    for n in range(times):
        ground.profile(seen, Pose2D(), 0.05 * n)
    return ground


def crossing(ground: GroundMap) -> GroundCrossing:
    return GroundCrossing(ground, LIMITS, 0.15)


@pytest.mark.parametrize(
    ("feature", "kind", "crossable"),
    [
        ((0.5, 0.55, -0.2), "ditch", True),
        ((0.5, 0.9, -0.2), "ditch", False),
        ((0.5, 0.9, -0.008), "ditch", True),
        ((0.5, 0.6, 0.008), "bump", True),
        ((0.5, 0.6, 0.03), "bump", False),
        ((0.5, 0.9, -inf), "ditch", False),
    ],
)
def test_what_wheels_can_do_decides(feature: tuple[float, float, float], kind: str, crossable: bool) -> None:
    ground = looked_at(profile(feature))
    if crossable:
        assert ground.ahead is not None
        assert ground.ahead.kind == kind
        assert ground.points(Pose2D(), 2.0) == []
    else:
        assert ground.ahead is None
        assert ground.nearest(0.6, 0.0, 0.5)[0] == kind
        assert ground.points(Pose2D(), 2.0) != []


def test_a_hole_on_one_line_is_a_pothole() -> None:
    assert looked_at(profile((0.5, 0.9, -0.2), lines=(1,))).nearest(0.6, 0.0, 0.5)[0] == "pothole"


def test_a_hole_with_a_round_edge_is_a_pothole() -> None:
    assert looked_at(profile((0.5, 0.9, -0.2), shift=-0.15)).nearest(0.6, 0.0, 0.5)[0] == "pothole"


def test_one_bad_reading_is_no_hole() -> None:
    assert looked_at(profile((0.5, 0.9, -0.2)), times=SEEN_MIN - 1).points(Pose2D(), 2.0) == []


def test_bad_readings_now_and_then_in_one_place_are_no_hole() -> None:
    ground = GroundMap(LIMITS)
    for n in range(5):
        ground.profile(profile((0.5, 0.55, -0.2), lines=(n % 3,)), Pose2D(), 2.0 * n)
        assert ground.ahead is None
    assert ground.points(Pose2D(), 2.0) == []


def test_a_look_counts_once_for_a_cell_however_many_of_its_readings_lie_in_it() -> None:
    rows = tuple(tuple(0.09 if line == 1 and n == 20 else 0.0 for n in range(46)) for line in range(3))
    bad = GroundProfile(HEADER, 0.1, 0.02, (0.12, 0.0, -0.12), rows)
    assert looked_at(bad, times=SEEN_MIN - 1).points(Pose2D(), 2.0) == []
    assert looked_at(bad, times=SEEN_MIN).points(Pose2D(), 2.0) != []


def test_a_bump_is_as_high_as_most_of_its_readings() -> None:
    rows = profile((0.5, 0.7, 0.009)).heights_m
    noisy = tuple(tuple(0.013 if n == 9 else h for n, h in enumerate(row)) for row in rows)
    ground = looked_at(GroundProfile(HEADER, 0.1, STEP, (0.12, 0.0, -0.12), noisy))
    assert ground.ahead is not None
    assert ground.ahead.kind == "bump"


def test_a_missing_reading_is_neither_hole_nor_floor() -> None:
    rows = profile((0.5, 0.9, -0.2)).heights_m
    holed = tuple(tuple(nan if n == 12 else h for n, h in enumerate(row)) for row in rows)
    ground = looked_at(GroundProfile(HEADER, 0.1, STEP, (0.12, 0.0, -0.12), holed))
    assert ground.nearest(0.6, 0.0, 0.5)[0] == "ditch"


def test_what_has_no_visible_end_is_judged_from_nearer_by() -> None:
    assert looked_at(profile((1.3, 9.0, 0.008))).points(Pose2D(), 2.0) == []
    assert looked_at(profile((0.5, 9.0, -0.2))).points(Pose2D(), 2.0) != []


def test_barred_floor_stays_where_it_is() -> None:
    ground = looked_at(profile((0.5, 0.9, -0.2)))
    nearest = min(x for x, _ in ground.points(Pose2D(0.3, 0.0, 0.0), 2.0))
    assert nearest == pytest.approx(0.2, abs=0.06)


def test_crossing_is_slow_until_the_robot_is_behind_it() -> None:
    ground = looked_at(profile((0.4, 0.45, -0.2)))
    over = crossing(ground)
    assert over.cross(Twist(0.5, 0.1), 0.0) == Twist(CROSSING_MPS, 0.1 * CROSSING_MPS / 0.5)
    assert over.decision is not None
    assert over.decision.action == "overcome"
    ground.profile(profile(), Pose2D(), 0.9)
    assert over.cross(Twist(0.5, 0.0), 1.0).linear_x == CROSSING_MPS
    assert over.cross(Twist(0.5, 0.0), 6.0) == Twist(0.5, 0.0)
    assert over.decision is None


def looking(near_m: float, width_m: float, lines: tuple[int, ...] = (0, 1, 2)) -> GroundProfile:
    """Readings every 2 cm as far as 1 m: a deep hole on `lines`."""
    row = tuple(-0.2 if near_m <= 0.1 + 0.02 * n < near_m + width_m else 0.0 for n in range(46))
    rows = tuple(row if line in lines else (0.0,) * 46 for line in range(3))
    return GroundProfile(HEADER, 0.1, 0.02, (0.12, 0.0, -0.12), rows)


def test_a_hole_whose_end_a_nearer_look_shows_is_not_taken_for_endless() -> None:
    ground = GroundMap(LIMITS)
    for n, near_m in enumerate((0.59, 0.57, 0.55, 0.53)):
        ground.profile(looking(near_m, 0.49), Pose2D(0.6 - near_m, 0.0, 0.0), 0.05 * n)
    assert ground.points(Pose2D(), 2.0) == []
    for n, near_m in enumerate((0.49, 0.47, 0.45, 0.43)):
        ground.profile(looking(near_m, 0.49), Pose2D(0.6 - near_m, 0.0, 0.0), 0.2 + 0.05 * n)
    found = ground.nearest(0.6, 0.0, 0.3)
    assert found is not None
    assert found[1] == pytest.approx(0.49, abs=0.03)


@pytest.mark.parametrize("near_m", [0.4, 0.7])
def test_what_may_be_a_hole_is_braked_for_before_it_is_believed(near_m: float) -> None:
    ground = looked_at(looking(near_m, 0.9, lines=(2,)), times=1)
    assert ground.points(Pose2D(), 2.0) == []
    braked_for = ground.doubtful(Pose2D(0.1, 0.0, 0.0))
    assert braked_for == [pytest.approx((near_m - 0.1, -0.12), abs=0.02)]
    fast = Twist(1.0, 0.0)
    assert safe(fast, fast, braked_for, 0.15, LIMITS, 0.02).linear_x < 1.0


def test_one_bad_reading_is_not_braked_for() -> None:
    assert looked_at(looking(0.5, 0.02, lines=(1,)), times=1).doubtful(Pose2D()) == []


@pytest.mark.parametrize("wanted", [Twist(1.0, 1.7), Twist(0.8, -1.6)])
def test_in_a_bend_the_robot_stops_before_what_a_look_ahead_shows_there_first(wanted: Twist) -> None:
    slower = crossing(looked_at(profile(), times=1)).cross(wanted, 0.0)
    v, radius_m = slower.linear_x, abs(slower.linear_x / slower.angular_z)
    assert v / slower.angular_z == pytest.approx(wanted.linear_x / wanted.angular_z)
    assert LATE_S * v + v * v / (2.0 * LIMITS.a_max_mps2) <= (2.0 * radius_m * BESIDE_M) ** 0.5 + 1e-9


@pytest.mark.parametrize("wanted", [Twist(1.0, 0.0), Twist(0.3, 0.6), Twist(0.0, 2.0), Twist(-0.3, 1.5)])
def test_straight_on_and_in_slow_bends_nothing_is_slowed(wanted: Twist) -> None:
    assert crossing(looked_at(profile(), times=1)).cross(wanted, 0.0) == wanted


def test_a_robot_that_does_not_look_at_the_floor_is_not_slowed_in_a_bend() -> None:
    assert crossing(GroundMap(LIMITS)).cross(Twist(1.0, 1.7), 0.0) == Twist(1.0, 1.7)


def test_a_gap_that_seemed_too_wide_askew_bars_nothing_once_it_is_seen_straight_on() -> None:
    ground = GroundMap(LIMITS)
    for n in range(SEEN_MIN):
        ground.profile(looking(0.5, 0.12), Pose2D(), 0.05 * n)
    assert ground.points(Pose2D(), 2.0) != []
    for n in range(SEEN_MIN):
        for near_m in (0.5, 0.54, 0.6):
            ground.profile(looking(near_m, 0.04), Pose2D(), 0.3 + 0.05 * n)
    assert ground.points(Pose2D(), 2.0) == []


def test_the_rim_of_a_round_hole_on_one_line_frees_nothing() -> None:
    ground = looked_at(looking(0.5, 0.4, lines=(1,)))
    before = ground.points(Pose2D(), 2.0)
    for n in range(SEEN_MIN):
        ground.profile(looking(0.5, 0.04, lines=(1,)), Pose2D(), 0.2 + 0.05 * n)
    assert ground.points(Pose2D(), 2.0) == before != []
