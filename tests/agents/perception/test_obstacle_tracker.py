"""What the points of a scan belong to, and what moves."""

from math import atan2, cos, hypot, inf, pi, sin, sqrt
from random import Random

import pytest

from lfa.agents.perception.obstacle_tracker import KEEPS_S, Tracker
from lfa.agents.perception.scan import SIGHT_M, Point


def arc(x: float, y: float, r: float, eye: Point) -> list[Point]:
    """The visible half of a circle, in beam order."""
    facing = pi + (0.0 if (x, y) == eye else atan2(y - eye[1], x - eye[0]))
    return [(x + r * cos(facing + n * pi / 20), y + r * sin(facing + n * pi / 20)) for n in range(9, -10, -1)]


def seen(positions: list[Point], eyes: list[Point], mates: list[Point] | None = None) -> Tracker:
    """Ten scans a second of one round thing of radius 0.25 m."""
    tracker = Tracker()
    for n, ((x, y), eye) in enumerate(zip(positions, eyes, strict=True)):
        tracker.update(arc(x, y, 0.25, eye), eye, mates or [], 0.5, 0.1 * n)
    return tracker


def test_a_thing_that_stands_is_stationary_where_it_stands() -> None:
    [feature] = seen([(2.0, 0.3)] * 20, [(0.0, 0.0)] * 20).features(1.9)
    assert feature.kind == "stationary"
    assert hypot(feature.x - 2.0, feature.y - 0.3) < 0.05
    assert feature.radius_m == pytest.approx(0.25, abs=0.03)


def test_a_thing_that_the_robot_drives_past_does_not_move() -> None:
    eyes = [(0.05 * n, 0.0) for n in range(40)]
    assert seen([(1.0, 0.6)] * 40, eyes).moving(3.9) == []


def scan_among(posts: list[tuple[float, float, float]], eye: Point) -> list[Point]:
    """The points that 180 beams from `eye` show of round posts (x, y, radius), in beam order."""
    points = []
    for n in range(180):
        c, s = cos(-pi + n * pi / 90), sin(-pi + n * pi / 90)
        ranges = [
            along - sqrt(r * r - off * off)
            for x, y, r in posts
            if (along := (x - eye[0]) * c + (y - eye[1]) * s) > 0.0
            and abs(off := (x - eye[0]) * s - (y - eye[1]) * c) < r
        ]
        if ranges and min(ranges) < SIGHT_M:
            points.append((eye[0] + min(ranges) * c, eye[1] + min(ranges) * s))
    return points


@pytest.mark.parametrize("seed", range(2, 7))
def test_among_posts_that_hide_each_other_nothing_moves(seed: int) -> None:
    chance, tracker = Random(seed), Tracker()
    posts = [(chance.uniform(0.0, 8.0), chance.choice([-1, 1]) * chance.uniform(0.5, 2.2), 0.1) for _ in range(30)]
    for n in range(80):
        eye = 0.1 * n, 0.1 * sin(n / 6.0)
        tracker.update(scan_among(posts, eye), eye, [], 0.5, 0.1 * n, step_rad=pi / 90)
        assert tracker.moving(0.1 * n) == [], f"after {0.1 * n:.1f} s"


@pytest.mark.parametrize("speed", [0.2, 0.4])
def test_a_thing_that_moves_is_told_with_its_velocity(speed: float) -> None:
    positions = [(1.5, -1.0 + speed * 0.1 * n) for n in range(30)]
    [feature] = seen(positions, [(0.0, 0.0)] * 30).moving(2.9)
    assert feature.vx == pytest.approx(0.0, abs=0.05)
    assert feature.vy == pytest.approx(speed, abs=0.05)


@pytest.mark.parametrize("speed", [1.0, 1.5])
def test_what_comes_fast_is_told_before_it_has_come_a_metre(speed: float) -> None:
    scans = int(1.0 / (0.1 * speed))
    positions = [(4.5 - speed * 0.1 * n, 0.0) for n in range(scans)]
    [feature] = seen(positions, [(0.0, 0.0)] * scans).moving(0.1 * (scans - 1))
    assert feature.vx < -0.5 * speed


def test_what_comes_head_on_moves_also_where_a_team_mate_follows_right_behind() -> None:
    eye, tracker = (0.0, 0.0), Tracker()
    for n in range(30):
        ahead, behind = arc(4.0 - 0.03 * n, 0.05, 0.25, eye), arc(-1.0, -0.2, 0.15, eye)
        tracker.update([*ahead, *behind], eye, [(-1.0, -0.2)], 0.5, 0.1 * n)
    [feature] = tracker.moving(2.9)
    assert feature.vx == pytest.approx(-0.3, abs=0.05)


def test_what_paces_to_and_fro_moves_while_it_turns_round_too() -> None:
    tracker = Tracker()
    for n in range(160):
        y = abs((0.03 * n + 0.7) % 2.8 - 1.4) - 0.7
        tracker.update(arc(1.5, y, 0.25, (0.0, 0.0)), (0.0, 0.0), [], 0.5, 0.1 * n)
        assert n < 20 or tracker.moving(0.1 * n), f"after {0.1 * n:.1f} s, at {y:.2f} m"


def test_what_turns_again_and_again_is_expected_to_go_on_for_a_short_time_only() -> None:
    chance, x, y, positions = Random(5), 1.5, 0.0, []
    for n in range(90):
        if n % 10 == 0:
            way = chance.uniform(-pi, pi)
        x, y = x + 0.04 * cos(way), y + 0.04 * sin(way)
        positions.append((x, y))
    [feature] = seen(positions, [(0.0, 0.0)] * 90).moving(8.9)
    assert feature.at(4.0) == feature.at(KEEPS_S) != feature.at(0.5 * KEEPS_S)


def test_what_keeps_its_course_is_expected_to_go_on() -> None:
    positions = [(1.5, -1.5 + 0.03 * n) for n in range(90)]
    [feature] = seen(positions, [(0.0, 0.0)] * 90).moving(8.9)
    assert feature.keeps_s == inf


@pytest.mark.parametrize("speed", [0.03, 0.05, 0.1])
def test_what_creeps_is_told_with_its_mean_velocity(speed: float) -> None:
    positions = [(1.5, -0.3 + speed * 0.1 * n) for n in range(60)]
    [feature] = seen(positions, [(0.0, 0.0)] * 60).moving(5.9)
    assert feature.vx == pytest.approx(0.0, abs=0.02)
    assert feature.vy == pytest.approx(speed, abs=0.02)


def test_what_stands_does_not_creep_for_a_pose_that_is_corrected_once() -> None:
    positions = [(1.5, 0.0 if n < 30 else 0.14) for n in range(90)]
    tracker = Tracker()
    for n, place in enumerate(positions):
        tracker.update(arc(*place, 0.25, (0.0, 0.0)), (0.0, 0.0), [], 0.5, 0.1 * n)
        assert n < 36 or tracker.moving(0.1 * n) == [], f"after {0.1 * n:.1f} s"


def test_what_is_wide_is_a_wall() -> None:
    tracker = Tracker()
    tracker.update([(1.5, -1.0 + 0.1 * n) for n in range(21)], (0.0, 0.0), [], 0.5, 0.0)
    assert [feature.kind for feature in tracker.features(0.0)] == ["wall"]


def test_a_piece_of_wall_that_comes_into_sight_is_a_wall_and_does_not_move() -> None:
    tracker, reach_m = Tracker(), 1.6
    for n in range(30):
        eye = 1.4 + 0.04 * n, 0.0
        piece = [(3.0, y) for y in (0.05 * k for k in range(-40, 41)) if hypot(3.0 - eye[0], y) < reach_m]
        tracker.update(piece, eye, [], 0.5, 0.1 * n, reach_m)
    assert [feature.kind for feature in tracker.features(2.9)] == ["wall"]


def test_what_comes_out_from_behind_a_thing_does_not_move_for_one_end_stays() -> None:
    tracker, whole = Tracker(), [(1.5 - 0.4 * sin(k * pi / 20), -0.4 * cos(k * pi / 20)) for k in range(21)]
    for n in range(16):
        tracker.update(whole[: 6 + n], (0.0, 0.0), [], 0.5, 0.1 * n)
        assert tracker.moving(0.1 * n) == []


def test_a_thing_that_shows_beside_one_that_no_longer_does_is_another() -> None:
    places = [(1.5, 0.0)] * 15 + [(1.5, 0.4)] * 15
    for shown in range(1, len(places)):
        assert seen(places[:shown], [(0.0, 0.0)] * shown).moving(0.1 * shown - 0.1) == []


def test_a_team_mate_is_no_obstacle() -> None:
    assert seen([(1.5, 0.0)] * 5, [(0.0, 0.0)] * 5, mates=[(1.6, 0.1)]).features(0.4) == []


def test_what_is_cut_off_by_the_end_of_sight_is_not_tracked() -> None:
    assert seen([(SIGHT_M, 0.0)] * 5, [(0.0, 0.0)] * 5).features(0.4) == []


def test_what_is_no_longer_seen_is_forgotten() -> None:
    tracker = seen([(1.5, 0.0)] * 5, [(0.0, 0.0)] * 5)
    tracker.update([], (0.0, 0.0), [], 0.5, 2.0)
    assert tracker.features(2.0) == []


def test_what_moved_and_comes_out_from_behind_a_thing_is_known_to_move_at_once() -> None:
    eye = (0.0, 0.0)
    places = [(1.5, -1.0 + 0.03 * n) for n in range(60)]
    tracker = seen(places[:30], [eye] * 30)
    for n in range(30, 50):
        tracker.update([], eye, [], 0.5, 0.1 * n)
    tracker.update(arc(*places[50], 0.25, eye), eye, [], 0.5, 5.0)
    [feature] = tracker.moving(5.0)
    assert feature.vy == pytest.approx(0.3, abs=0.05)


def test_a_piece_of_a_thing_shows_and_a_wall_does_not() -> None:
    tracker = Tracker()
    tracker.update([(1.5, -1.0 + 0.1 * n) for n in range(21)] + [(0.0, 1.5)], (0.0, 0.0), [], 0.5, 0.0)
    assert tracker.shows(0.0, 1.5, 0.3)
    assert not tracker.shows(1.5, 0.0, 0.5)


def test_what_has_moved_of_late_is_told_to_move_again_by_its_centre_as_a_robot_passes() -> None:
    """As a robot passes, one end of it seems to stay: a walker that had stood came on untold for two seconds."""
    tracker, there, eye = Tracker(), (0.0, 0.0), (1.0, -2.0)
    for n in range(65):  # it goes for 3 s, and stands for 3.5 s
        there = (there[0] + (0.03 if n < 30 else 0.0), 0.0)
        tracker.update(arc(*there, 0.2, eye), eye, [], 0.6, 0.1 * n)
    assert tracker.moving(6.4) == []
    for n in range(65, 73):
        there, eye = (there[0], there[1] - 0.02), (eye[0] + 0.05, eye[1])
        tracker.update(arc(*there, 0.2, eye), eye, [], 0.6, 0.1 * n)
    assert tracker.moving(7.2) != []
