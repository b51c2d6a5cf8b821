"""Before a gap that a polygon meets aslant it backs off and comes again, but not for ever."""

from lfa.agents.recovery.run_up import PLACE_M, RUN_UP_M, TRIES_MAX, RunUp
from lfa.protocol.geometry import STILL, Pose2D, Twist

BACK = Twist(-0.15, 0.0)


def backed(run_up: RunUp, from_m: float) -> float:
    """Return the place to which a robot that is blocked at `from_m` backs off."""
    x, blocked = from_m, True
    while run_up.step(Pose2D(x, 0.0, 0.0), BACK, blocked=blocked) is not None:
        x, blocked = x - 0.01, False
    return x


def test_a_run_up_is_as_long_as_a_body_needs_to_come_in_squarely() -> None:
    assert abs(backed(RunUp(), 3.0) - (3.0 - RUN_UP_M)) < 0.011


def test_before_one_gap_there_are_so_many_run_ups_and_no_more() -> None:
    run_up = RunUp()
    assert [backed(run_up, 3.0) < 2.9 for _ in range(TRIES_MAX + 1)] == [True] * TRIES_MAX + [False]


def test_before_the_next_gap_there_are_run_ups_again() -> None:
    run_up = RunUp()
    for _ in range(TRIES_MAX):
        backed(run_up, 3.0)
    assert backed(run_up, 3.0 + PLACE_M + 0.6) < 3.0 + PLACE_M + 0.2


def test_a_run_up_ends_where_the_way_back_is_barred() -> None:
    run_up = RunUp()
    assert run_up.step(Pose2D(), BACK, blocked=True) == BACK
    assert run_up.step(Pose2D(), STILL, blocked=False) is None
    assert run_up.step(Pose2D(), BACK, blocked=False) is None
