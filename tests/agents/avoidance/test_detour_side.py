"""The side of a detour, its name, and its ends: what is held, for how long, and what ends it at once."""

from __future__ import annotations

from math import cos, inf, pi, sin

import pytest

from lfa.agents.avoidance.decision import Action, Decision
from lfa.agents.avoidance.detour import LEAST_M, Detour, _turning
from lfa.agents.avoidance.openings import NARROW_M, STEP_RAD
from lfa.agents.perception.obstacle import BlockingObstacle
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import STILL, Twist
from lfa.protocol.mission import Limits

RADIUS_M, BEGIN = 0.15, 100.0
WANTED, TURNS, TARGET = Twist(0.5, 0.0), Twist(0.0, 0.5), (2.0, 0.0)
LEFT, RIGHT = 1.0, -1.0
BOTH = pytest.mark.parametrize("side", [LEFT, RIGHT])


def fan(low: float, high: float) -> list[Point]:
    """Return points 0.7 m off, in the directions [rad] from `low` to `high`."""
    steps = round((high - low) / 0.05)
    bearings = [low + n * (high - low) / steps for n in range(steps + 1)]
    return [(0.7 * cos(b), 0.7 * sin(b)) for b in bearings]


RING = fan(-pi, pi)


def nearer_by(side: float, rad: float) -> list[Point]:
    """Return an obstacle ahead past which `side` needs less turning: its middle is `rad` off on the other side."""
    return fan(-0.5 - side * rad, 0.5 - side * rad)


def little(side: float) -> list[Point]:
    return nearer_by(side, 0.1)


def much(side: float) -> list[Point]:
    return nearer_by(side, 0.3)


def open_at(side: float) -> list[Point]:
    """Return an obstacle ahead that reaches round the robot, but for `side`."""
    return fan(-pi, 0.45) if side > 0.0 else fan(-0.45, pi)


def driven(*seen: tuple[float, list[Point]]) -> Detour:
    """Return a detour that has seen points, each some time [s] after the begin."""
    detour = Detour(RADIUS_M, Limits())
    for after_s, points in seen:
        detour.steer(points, TARGET, WANTED, 0.4, BEGIN + after_s)
    return detour


def decided(detour: Detour) -> Decision:
    assert detour.decision is not None
    return detour.decision


@BOTH
def test_the_first_scans_settle_the_side_anew_each_time(side: float) -> None:
    assert driven((0.0, little(-side)), (0.1, little(side)))._side == side


@BOTH
def test_once_settled_a_side_is_kept_that_needs_a_little_more_turning(side: float) -> None:
    assert driven((0.0, little(side)), (0.3, little(-side)))._side == side


@BOTH
def test_once_settled_a_side_that_needs_much_less_turning_is_taken_at_once(side: float) -> None:
    assert driven((0.0, little(-side)), (0.3, little(-side)), (0.4, much(side)))._side == side


@BOTH
@pytest.mark.parametrize(("after_s", "held"), [(1.3, True), (1.5, False)])
def test_a_change_of_sides_is_held_for_a_second(side: float, after_s: float, held: bool) -> None:
    detour = driven((0.0, little(-side)), (0.4, much(side)), (after_s, much(-side)))
    assert detour._side == (side if held else -side)


@BOTH
def test_a_side_without_an_opening_is_left_at_once(side: float) -> None:
    assert driven((0.0, little(-side)), (0.4, much(side)), (0.6, open_at(-side)))._side == -side


@BOTH
def test_without_a_side_yet_the_nearer_one_is_taken_however_late(side: float) -> None:
    assert driven((0.0, RING), (0.5, little(side)))._side == side


@BOTH
def test_past_an_obstacle_the_only_open_side_is_taken(side: float) -> None:
    assert decided(driven((0.0, open_at(side)))).action == ("left" if side > 0.0 else "right")


@pytest.mark.parametrize(("opening", "towards", "cost"), [(None, 0.3, inf), (0.5, 0.3, 0.45), (-0.4, 0.3, 0.9)])
def test_an_opening_costs_its_turn_off_the_target_and_half_of_that_off_the_robot(
    opening: float | None, towards: float, cost: float
) -> None:
    assert _turning(opening, towards) == pytest.approx(cost)


@BOTH
def test_the_direction_of_the_target_is_taken_as_soon_as_it_is_open(side: float) -> None:
    detour = driven((0.0, little(side)))
    detour.steer(little(side), (cos(1.3), side * sin(1.3)), WANTED, 0.4, BEGIN + 0.3)
    assert decided(detour).bearing == pytest.approx(side * 1.3)


@BOTH
def test_the_name_of_a_decision_is_held_for_a_second(side: float) -> None:
    named = decided(driven((0.0, little(side)))).action
    seen = (0.0, little(side)), (0.1, little(-side))
    assert decided(driven(*seen)).action == named
    assert decided(driven(*seen, (1.1, little(-side)))).action != named


@BOTH
def test_a_decision_tells_the_newest_bearing_and_free_distance(side: float) -> None:
    nearer = [(0.9 * x, 0.9 * y) for x, y in little(-side)]
    first, newest = decided(driven((0.0, little(side)))), decided(driven((0.0, little(side)), (0.1, nearer)))
    assert newest.bearing * side < 0.0
    assert newest.free_m < first.free_m


@BOTH
def test_a_decision_that_has_lasted_a_second_is_followed_by_another_at_once(side: float) -> None:
    seen = (0.0, little(side)), (1.2, little(side))
    assert decided(driven(*seen, (1.4, much(-side)))).action != decided(driven(*seen)).action


def test_that_no_way_is_left_is_told_at_once() -> None:
    assert decided(driven((0.0, little(LEFT)), (0.1, RING))).action == "blocked"


@pytest.mark.parametrize(
    ("seen", "moves"),
    [
        ([(0.0, little(LEFT))], True),
        ([(0.0, RING)], False),
        ([(0.0, RING), (0.1, little(LEFT))], False),
        ([(0.0, RING), (0.1, little(LEFT)), (0.4, little(LEFT))], False),
        ([(0.0, RING), (0.1, little(LEFT)), (0.6, little(LEFT))], True),
        ([(0.0, RING), (0.1, little(LEFT)), (0.3, RING), (0.6, little(LEFT))], False),
    ],
)
def test_a_blocked_robot_moves_once_an_opening_has_lasted_four_tenths_of_a_second(
    seen: list[tuple[float, list[Point]]], moves: bool
) -> None:
    detour = driven(*seen[:-1])
    twist = detour.steer(seen[-1][1], TARGET, WANTED, 0.4, BEGIN + seen[-1][0])
    assert (twist != STILL) is moves
    assert (decided(detour).action != "blocked") is moves


def test_the_time_of_an_opening_begins_anew_where_another_behaviour_says_blocked() -> None:
    detour = driven((0.0, RING), (0.1, little(LEFT)), (0.6, little(LEFT)), (0.7, little(LEFT)))
    detour.decision = Decision(Action.BLOCKED, 0.0, 0.0)
    assert detour.steer(little(LEFT), TARGET, WANTED, 0.4, BEGIN + 0.8) == STILL


@BOTH
def test_out_of_a_pocket_the_robot_turns_to_the_side_it_is_on(side: float) -> None:
    """The first direction with a wide margin to the pocket's ends, at 123 degrees, is 157.5 degrees aside."""
    detour = driven((0.0, little(side)), (1.2, fan(-2.15, 2.15)))
    assert decided(detour).action == "u_turn"
    assert decided(detour).bearing == pytest.approx(side * 21 * STEP_RAD)


def test_out_of_a_pocket_a_robot_without_a_side_turns_left() -> None:
    assert decided(driven((0.0, fan(-2.15, 2.15)))).bearing == pytest.approx(21 * STEP_RAD)


@pytest.mark.parametrize(("after_s", "ended"), [(0.9, False), (1.1, True)])
def test_a_detour_lasts_a_second_although_its_way_is_free(after_s: float, ended: bool) -> None:
    assert (driven((0.0, little(LEFT)), (0.1, []), (after_s, [])).decision is None) is ended


@pytest.mark.parametrize(
    ("seen", "ended"),
    [
        ([(1.5, [])], False),
        ([(1.5, []), (1.8, [])], False),
        ([(1.5, []), (2.0, [])], True),
    ],
)
def test_a_detour_ends_where_the_way_was_free_for_four_tenths_of_a_second(
    seen: list[tuple[float, list[Point]]], ended: bool
) -> None:
    assert (driven((0.0, little(LEFT)), *seen).decision is None) is ended


@pytest.mark.parametrize(
    ("target", "point", "ended"),
    [
        (TARGET, (1.0, 0.15), False),
        (TARGET, (1.0, 0.3), True),
        (TARGET, (0.7, 0.7), True),
        ((0.0, 2.0), (0.15, 1.0), False),
        ((0.5, 0.0), (0.9, 0.0), True),
    ],
)
def test_what_bars_the_straight_way_to_the_target_within_the_clearance_keeps_up_the_detour(
    target: Point, point: Point, ended: bool
) -> None:
    """The robot turns on the spot: nothing bars that."""
    detour = driven((0.0, little(LEFT)))
    for after_s in (1.5, 2.0):
        detour.steer([point], target, TURNS, 0.4, BEGIN + after_s)
    assert (detour.decision is None) is ended


def test_a_way_to_the_target_that_was_barred_has_to_be_free_for_as_long_again() -> None:
    detour = driven((0.0, little(LEFT)))
    for after_s, points in ((1.5, []), (1.6, [(1.0, 0.0)]), (1.95, [])):
        detour.steer(points, TARGET, TURNS, 0.4, BEGIN + after_s)
    assert detour.decision is not None


def test_one_scan_in_which_the_motion_is_free_ends_no_detour() -> None:
    """The straight way to the target is free all the time, the bend that the law wants only now and then."""
    detour, bends = driven((0.0, little(LEFT))), Twist(0.5, 1.0)
    for after_s, points in ((1.5, []), (1.7, [(0.49, 0.41)]), (2.0, [])):
        detour.steer(points, TARGET, bends, 0.4, BEGIN + after_s)
    assert detour.decision is not None


def test_a_decision_of_another_behaviour_ends_like_one_of_its_own() -> None:
    detour = Detour(RADIUS_M, Limits())
    detour.decision = Decision(Action.MAKE_ROOM, inf, 0.0)
    detour.steer([], TARGET, WANTED, 0.4, BEGIN)
    assert detour.steer([], TARGET, WANTED, 0.4, BEGIN + 0.5) is None


def test_a_decision_of_another_behaviour_holds_no_name() -> None:
    detour = Detour(RADIUS_M, Limits())
    detour.decision = Decision(Action.MAKE_ROOM, inf, 0.0)
    detour.steer(little(LEFT), TARGET, WANTED, 0.4, BEGIN)
    assert decided(detour).action == "left"


@pytest.mark.parametrize(("clear_m", "kept_m"), [(0.3, NARROW_M), (0.065, 0.06), (0.01, LEAST_M)])
def test_the_kept_clearance_is_at_most_5_mm_less_than_the_present_one(clear_m: float, kept_m: float) -> None:
    detour = driven((0.0, [*little(LEFT), (0.0, -RADIUS_M - clear_m)]))
    assert detour._kept_m == pytest.approx(kept_m)


@pytest.mark.parametrize(("free_m", "begins"), [(0.60, True), (0.62, False)])
def test_a_detour_begins_within_the_way_to_brake_and_a_headway(free_m: float, begins: bool) -> None:
    """0.5 m/s, braked at 2 m/s^2: 0.0625 m, and 0.4 m in 0.8 s, and 0.15 m."""
    detour = Detour(RADIUS_M, Limits(a_max_mps2=2.0))
    detour.steer([(free_m + RADIUS_M + NARROW_M, 0.0)], TARGET, WANTED, 0.4, BEGIN)
    assert (detour.decision is not None) is begins


@pytest.mark.parametrize(("x", "begins"), [(-0.35, True), (0.35, False)])
def test_backwards_what_lies_behind_is_still_to_be_passed(x: float, begins: bool) -> None:
    twist = Detour(RADIUS_M, Limits()).steer([(x, -0.2)], (-2.0, 0.0), Twist(-0.3, 0.0), 0.3, BEGIN)
    assert (twist is not None) is begins


def test_what_lies_beyond_a_near_target_bars_no_opening() -> None:
    detour = Detour(RADIUS_M, Limits())
    around = [(1.2 * cos(n * 0.1), 1.2 * sin(n * 0.1)) for n in range(63)]
    detour.steer([(0.45, 0.0), *around], (0.5, 0.0), WANTED, 0.4, BEGIN)
    assert decided(detour).action in ("left", "right")


def test_a_robot_drives_as_much_slower_as_it_has_to_turn() -> None:
    twist = Detour(RADIUS_M, Limits()).steer([(0.6, 0.1)], TARGET, WANTED, 0.4, BEGIN)
    assert twist == Twist(pytest.approx(0.4 * cos(4 * STEP_RAD)), pytest.approx(-Limits().omega_max_radps * 0.65, 0.05))


def creeping(seconds: int, seen: BlockingObstacle, asked: list[float]) -> Detour:
    """Return a detour that asks once a second what blocks it: first it has no visible end, then it is `seen`."""
    detour = Detour(RADIUS_M, Limits(), period_s=1.0)

    def obstacle(free_m: float) -> BlockingObstacle:
        asked.append(free_m)
        return BlockingObstacle("stationary", inf) if len(asked) == 1 else seen

    for n in range(seconds):
        detour.steer(little(LEFT), TARGET, WANTED, 0.4, BEGIN + 1.1 * n, obstacle)
    return detour


def test_what_a_creeping_robot_sees_anew_decides() -> None:
    asked: list[float] = []
    assert decided(creeping(2, BlockingObstacle("stationary", 0.4), asked)).action == "left"
    assert asked == pytest.approx([0.7 - RADIUS_M - NARROW_M] * 2, abs=0.02)


def test_a_robot_that_does_not_creep_asks_no_more_what_blocks_it() -> None:
    asked: list[float] = []
    creeping(5, BlockingObstacle("stationary", 0.4), asked)
    assert len(asked) == 2


def test_after_creeping_in_vain_the_robot_turns_to_the_first_direction_back() -> None:
    detour = creeping(3, BlockingObstacle("stationary", inf), [])
    assert decided(detour).action == "u_turn"
    assert abs(decided(detour).bearing) == pytest.approx(19 * STEP_RAD)


@pytest.mark.parametrize(("behind", "action"), [([], "back"), ([(-0.2, 0.17)], "blocked"), ([(-0.4, 0.17)], "back")])
def test_a_robot_with_a_wall_at_its_bend_backs_off_where_there_is_room_behind_it(
    behind: list[Point], action: str
) -> None:
    detour = Detour(RADIUS_M, Limits())
    wall = BlockingObstacle("wall", 0.5)
    detour.steer([(0.17, 0.17), *behind], TARGET, Twist(0.3, 1.2), 0.4, BEGIN, lambda _free_m: wall)
    assert decided(detour).action == action
