"""S1 to S5: when a robot is stuck, and when it only waits."""

import pytest

from lfa.agents.avoidance.decision import Action
from lfa.agents.recovery.stuck_detector import (
    BACK_S,
    BLOCKED_S,
    CELL_ENTRIES,
    SCAN_LOST,
    STILL_M,
    STILL_S,
    TURN_S_MIN,
    TURNS,
    WAITING_S,
    StuckConditions,
)
from lfa.protocol.geometry import STILL, Pose2D, Twist

AHEAD = Twist(0.4, 0.0)


def watched(seconds: float, wanted: Twist = AHEAD, action: Action | None = None, speed: float = 0.0) -> str | None:
    stuck, reason = StuckConditions(), None
    for n in range(round(seconds / 0.02)):
        reason = stuck.watch(Pose2D(speed * 0.02 * n, 0.0, 0.0), wanted, action, None, 0.02 * n)
    return reason


def test_S1_commanded_to_move_and_did_not() -> None:
    assert str(watched(STILL_S + 0.2)).startswith("S1")
    assert watched(STILL_S - 0.5) is None
    assert watched(10.0, speed=0.2) is None


def test_S1_holds_where_the_localization_says_one_place_while_the_wheels_drive_on() -> None:
    stuck, reason = StuckConditions(), None
    for n in range(round((STILL_S + 0.2) / 0.02)):
        reason = stuck.watch(Pose2D(0.004 * n, 0.0, 0.0), AHEAD, None, None, 0.02 * n, hung_at=Pose2D(0.01 * (n % 2)))
    assert str(reason).startswith("S1")


def test_who_is_not_asked_to_move_is_not_stuck() -> None:
    assert watched(20.0, wanted=STILL) is None


def test_S2_blocked_on_all_sides() -> None:
    assert str(watched(2.0, STILL, Action.BLOCKED)).startswith("S2")
    assert watched(1.0, STILL, Action.BLOCKED) is None


def test_S3_turned_round_again_and_again() -> None:
    stuck, reason = StuckConditions(), None
    for n in range(TURNS):
        stuck.watch(Pose2D(), STILL, Action.LEFT, None, 2.0 * n)
        reason = stuck.watch(Pose2D(), STILL, Action.U_TURN, None, 2.0 * n + 1.0)
    assert str(reason).startswith("S3")


def test_S3_in_the_same_place_again_and_again() -> None:
    stuck, reason = StuckConditions(), None
    for n in range(CELL_ENTRIES):
        reason = stuck.watch(Pose2D(0.1, 0.1, 0.0), AHEAD, Action.LEFT, None, 4.0 * n)
        if n < CELL_ENTRIES - 1:
            assert reason is None
            stuck.watch(Pose2D(1.1, 0.1, 0.0), AHEAD, Action.LEFT, None, 4.0 * n + 2.0)
    assert str(reason).startswith("S3")


def test_who_avoids_nothing_may_come_back_as_often_as_its_slot_or_route_does() -> None:
    """A slot swings behind a slow chain, and a route may cross itself; what was avoided before does not count on."""
    stuck = StuckConditions()
    for n in range(4 * CELL_ENTRIES):
        action = Action.LEFT if n == 0 else None
        assert stuck.watch(Pose2D(0.1 + n % 2, 0.1, 0.0), AHEAD, action, None, 2.0 * n) is None


@pytest.mark.parametrize("y", [0.1, 5.1])
def test_noise_on_a_cells_border_is_no_coming_back(y: float) -> None:
    stuck = StuckConditions()
    for n in range(500):
        x = 0.5 + (0.004 if n % 2 else -0.004) + 0.0002 * n
        assert stuck.watch(Pose2D(x, y, 0.0), STILL, Action.LEFT, None, 0.02 * n) is None


def entered(*at_s: float, action_before: Action | None = Action.LEFT) -> str | None:
    """Return the reason after these times [s] of entering a place along y, with another place a second before each."""
    stuck, reason = StuckConditions(), None
    for n, now in enumerate(at_s):
        action = Action.LEFT if n else action_before
        stuck.watch(Pose2D(0.1, 1.1, 0.0), AHEAD, action, None, now - 1.0)
        reason = stuck.watch(Pose2D(0.1, 0.1, 0.0), AHEAD, action, None, now)
    return reason


def test_S3_counts_the_entries_of_the_last_30_s() -> None:
    assert str(entered(101.0, 115.0, 130.9)).startswith("S3")
    assert entered(101.0, 120.0, 131.1) is None


def test_S3_counts_only_entries_before_which_something_was_avoided() -> None:
    assert entered(1.0, 5.0, 9.0, action_before=None) is None
    stuck = StuckConditions()
    for now, x in enumerate((0.1, 1.1, 0.1, 1.1, 0.1)):  # it begins there, without having avoided anything
        assert stuck.watch(Pose2D(x, 0.1, 0.0), AHEAD, Action.LEFT if now else None, None, float(now)) is None
    assert str(entered(1.0, 5.0, 9.0)).startswith("S3")


def test_S4_waited_too_long_for_what_moves() -> None:
    assert str(watched(WAITING_S + 0.2, STILL, Action.WAIT)).startswith("S4")


def test_S5_scan_lost() -> None:
    assert str(StuckConditions().watch(Pose2D(), STILL, None, SCAN_LOST, 0.0)).startswith("S5")


def test_a_reset_forgets() -> None:
    stuck = StuckConditions()
    for n in range(200):
        stuck.watch(Pose2D(), AHEAD, None, None, 0.02 * n)
    stuck.reset()
    assert stuck.watch(Pose2D(), AHEAD, None, None, 4.02) is None


@pytest.mark.parametrize("place", [Pose2D(0.0, 3.0, 0.0), Pose2D(3.0, 0.0, 0.0)])
def test_S1_holds_beside_the_axes_too(place: Pose2D) -> None:
    stuck, reason = StuckConditions(), None
    for n in range(round((STILL_S + 0.2) / 0.02)):
        reason = stuck.watch(place, AHEAD, None, None, 0.02 * n)
    assert str(reason).startswith("S1")


def test_S1_who_went_there_and_back_has_moved() -> None:
    stuck, reason = StuckConditions(), None
    for n in range(round((STILL_S + 0.2) / 0.02)):
        x = 2.0 * STILL_M if 50 < n < 100 else 0.0
        reason = stuck.watch(Pose2D(x, 0.0, 0.0), AHEAD, None, None, 0.02 * n)
    assert reason is None


def test_S1_counts_from_when_motion_was_wanted_last() -> None:
    stuck, reason = StuckConditions(), None
    for n in range(round((STILL_S + 0.3) / 0.02)):
        wanted = STILL if n == round((STILL_S - 0.2) / 0.02) else AHEAD
        reason = stuck.watch(Pose2D(), wanted, None, None, 0.02 * n)
    assert reason is None


@pytest.mark.parametrize(
    ("action", "longest_s"), [(Action.WAIT, WAITING_S), (Action.BLOCKED, BLOCKED_S), (Action.BACK, BACK_S)]
)
def test_an_action_is_too_long_from_its_own_beginning(action: Action, longest_s: float) -> None:
    stuck, begin_s = StuckConditions(), 100.0
    stuck.watch(Pose2D(), STILL, None, None, begin_s - 0.1)
    stuck.watch(Pose2D(), STILL, action, None, begin_s)
    assert stuck.watch(Pose2D(), STILL, action, None, begin_s + 0.99 * longest_s) is None
    assert stuck.watch(Pose2D(), STILL, action, None, begin_s + 1.01 * longest_s) is not None


def turned(*at_s: float, action: Action = Action.U_TURN) -> str | None:
    """Return the reason after turns at these times [s], with another action between them."""
    stuck, reason = StuckConditions(), None
    for now in at_s:
        stuck.watch(Pose2D(), STILL, Action.LEFT, None, now - 0.01)
        reason = stuck.watch(Pose2D(), STILL, action, None, now)
    return reason


def test_S3_counts_turns_from_the_first_of_three() -> None:
    assert turned(1.0, 7.0, 10.9) is not None
    assert turned(1.0, 7.0, 11.1) is None


def test_S3_counts_u_turns_only_and_flickering_ones_once() -> None:
    assert turned(1.0, 3.0, 5.0, action=Action.RIGHT) is None
    assert turned(1.0, 3.0, 3.0 + 0.9 * TURN_S_MIN) is None
    assert turned(1.0, 3.0, 3.0 + 1.1 * TURN_S_MIN) is not None


def test_S3_forgets_the_place_that_was_entered_first_when_it_remembers_256() -> None:
    stuck, reason = StuckConditions(), None
    there_and_back = [0, 1, 0]
    for n, cell in enumerate([*there_and_back, *range(2, 257), 0]):
        reason = stuck.watch(Pose2D(0.1 + 0.5 * cell, 0.1, 0.0), AHEAD, Action.LEFT, None, 0.1 * n)
    assert reason is None
    stuck = StuckConditions()
    for n, cell in enumerate([*there_and_back, *range(2, 256), 0]):
        reason = stuck.watch(Pose2D(0.1 + 0.5 * cell, 0.1, 0.0), AHEAD, Action.LEFT, None, 0.1 * n)
    assert str(reason).startswith("S3")


@pytest.mark.parametrize("place", [Pose2D(7.1, 0.1, 0.0), Pose2D(0.1, 7.1, 0.0)])
def test_S3_places_are_half_a_metre_wide_along_both_axes(place: Pose2D) -> None:
    stuck, reason = StuckConditions(), None
    for n in range(CELL_ENTRIES):
        stuck.watch(Pose2D(place.x + 1.0, place.y + 1.0, 0.0), AHEAD, Action.LEFT, None, 4.0 * n)
        off_m = 0.1 * n  # within the same half metre
        reason = stuck.watch(Pose2D(place.x + off_m, place.y + off_m, 0.0), AHEAD, Action.LEFT, None, 4.0 * n + 2.0)
    assert str(reason).startswith("S3")
