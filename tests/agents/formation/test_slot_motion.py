"""The moving slot alone: where it starts, how fast (k, phi) and the offset change, and the room its speed leaves."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import pytest

from lfa.agents.config import DEFAULT
from lfa.agents.formation.pose_history import PoseHistory
from lfa.agents.formation.slot_motion import BLEND_SHARE_MIN, SlotMotion, _approach, _share
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Limits

DT = 0.02
BEHIND = Slot(2, 1.2, pi)
CLOSER = Slot(2, 0.6, pi)
DIAGONAL = Pose2D(2.0, 2.0, pi / 4)
"""Pose of the predecessor at the end of `diagonal()`."""


def moving(
    slot: Slot = BEHIND, predecessor: Pose2D | None = None, v_max_mps: float = 1.0, filter_m: float = 0.0
) -> SlotMotion:
    motion = SlotMotion(DEFAULT, Limits(v_max_mps=v_max_mps), filter_m)
    motion.reset(slot, predecessor or Pose2D())
    return motion


def diagonal() -> PoseHistory:
    trace = PoseHistory(4.0)
    for n in range(101):
        trace.add(Pose2D(0.02 * n, 0.02 * n, pi / 4))
    return trace


@pytest.mark.parametrize(
    ("b", "limit"), [((0.6, 0.5), 0.9), ((0.6, -1.5), 0.9), ((0.2, 0.9), 0.9), ((-2.0, 0.3), 0.7), ((1.0, 0.0), 0.6)]
)
def test_a_blend_takes_exactly_the_room_that_the_slots_speed_leaves(b: tuple[float, float], limit: float) -> None:
    share = _share(0.3, 0.4, *b, limit)
    assert 0.0 < share < 1.0
    assert hypot(0.3 + share * b[0], 0.4 + share * b[1]) == pytest.approx(limit)


def test_a_blend_that_fits_is_whole_and_one_beside_a_slot_that_is_too_fast_is_none() -> None:
    assert _share(0.3, 0.4, 0.4, -0.6, 0.9) == 1.0
    assert _share(0.3, 0.4, 0.2, 0.3, hypot(0.5, 0.7)) == 1.0
    assert _share(0.9, 0.9, 0.1, 0.1, 0.9) == 0.0
    assert _share(0.0, -0.9, 0.5, -0.5, 0.9) == 0.0


def test_a_value_arrives_at_its_target_exactly() -> None:
    assert _approach(0.1, 0.2, 0.3) == 0.3
    assert _approach(0.1, 0.1, 0.3) == 0.2


def test_a_distance_changes_at_its_rate_and_the_slot_moves_by_it() -> None:
    motion = moving()
    motion.step(CLOSER, Pose2D(), Twist(0.5, 0.0), DT)
    assert motion.separation_m == pytest.approx(1.2 - DEFAULT.separation_rate_max_mps * DT)
    assert (motion.vx, motion.vy) == pytest.approx((0.5 + DEFAULT.separation_rate_max_mps, 0.0))
    assert not motion.settled


def test_a_fast_drive_blends_at_full_rate_behind_a_fast_predecessor() -> None:
    motion = moving(v_max_mps=2.0)
    motion.step(CLOSER, Pose2D(), Twist(1.4, 0.0), DT)
    assert motion.separation_m == pytest.approx(1.2 - DEFAULT.separation_rate_max_mps * DT)


def test_behind_a_predecessor_at_full_speed_a_blend_still_has_its_least_share() -> None:
    motion = moving()
    motion.step(Slot(2, 1.2, 2.0 * pi / 3.0), Pose2D(), Twist(1.0, 0.0), DT)
    assert motion.phi == pytest.approx(pi - BLEND_SHARE_MIN * DEFAULT.phi_rate_max_radps * DT)
    assert motion.vy == pytest.approx(BLEND_SHARE_MIN * 1.2 * DEFAULT.phi_rate_max_radps)


def test_a_bearing_changes_at_its_rate_across_the_line_to_the_predecessor() -> None:
    motion = moving(predecessor=Pose2D(0.0, 0.0, 0.3))
    motion.step(Slot(2, 1.2, 2.0 * pi / 3.0), Pose2D(0.0, 0.0, 0.3), STILL, DT)
    across = 1.2 * DEFAULT.phi_rate_max_radps
    assert (motion.vx, motion.vy) == pytest.approx((-across * sin(0.3), across * cos(0.3)))
    assert motion.phi == pytest.approx(pi - DEFAULT.phi_rate_max_radps * DT)


@pytest.mark.parametrize(("off_m", "rate_mps"), [(0.5, 0.3), (0.05, 0.11)])
def test_an_offset_shrinks_along_its_own_direction_and_slowly_at_its_end(off_m: float, rate_mps: float) -> None:
    motion = moving()
    motion.step(BEHIND, Pose2D(), STILL, DT)
    motion.hang_at(motion.x + 0.6 * off_m, motion.y - 0.8 * off_m)
    motion.step(BEHIND, Pose2D(), STILL, DT)
    assert (motion.x, motion.y) == pytest.approx((-1.2 + 0.6 * off_m, -0.8 * off_m))
    assert (motion.vx, motion.vy) == pytest.approx((-0.6 * rate_mps, 0.8 * rate_mps))
    left_m = off_m - rate_mps * DT
    assert (motion.offset_x, motion.offset_y) == pytest.approx((0.6 * left_m, -0.8 * left_m))


def test_a_slot_is_settled_in_the_step_after_its_blend_has_ended() -> None:
    motion = moving()
    motion.step(Slot(2, 1.2 - 0.5 * DEFAULT.separation_rate_max_mps * DT, pi), Pose2D(), STILL, DT)
    assert not motion.settled
    motion.step(Slot(2, 1.2 - 0.5 * DEFAULT.separation_rate_max_mps * DT, pi), Pose2D(), STILL, DT)
    assert motion.settled
    assert motion.separation_m == 1.2 - 0.5 * DEFAULT.separation_rate_max_mps * DT


@pytest.mark.parametrize(("theta", "rate"), [(1.0, 0.4), (-1.0, -0.4), (0.1, 0.1)])
def test_a_filtered_heading_turns_at_most_at_its_rate_to_either_side(theta: float, rate: float) -> None:
    motion = moving(filter_m=1.0)
    for _ in range(2):
        motion.step(BEHIND, Pose2D(0.0, 0.0, theta), Twist(1.0, 0.0), DT)
    assert motion.chi == pytest.approx(rate * DT)
    assert motion.chi_rate == pytest.approx(rate, abs=0.003)


@pytest.mark.parametrize("theta", [0.4, -2.0])
def test_an_old_reference_shifts_the_slot_ahead_along_the_heading(theta: float) -> None:
    predecessor = Pose2D(3.0, -1.0, theta)
    motion = moving(predecessor=predecessor)
    motion.lead_m = 0.1
    motion.step(BEHIND, predecessor, Twist(0.5, 0.2), DT)
    assert (motion.x, motion.y) == pytest.approx((3.0 - 1.1 * cos(theta), -1.0 - 1.1 * sin(theta)))
    assert motion.vx == pytest.approx(0.5 * cos(theta) + 0.2 * 1.1 * sin(theta))
    assert motion.vy == pytest.approx(0.5 * sin(theta) - 0.2 * 1.1 * cos(theta))


def test_without_a_filter_the_formation_has_the_predecessors_heading_and_turn_rate() -> None:
    motion = moving()
    motion.step(BEHIND, Pose2D(0.0, 0.0, 0.7), Twist(0.5, 0.3), DT)
    assert (motion.chi, motion.chi_rate) == (0.7, 0.3)


def test_on_a_trace_a_shorter_distance_drives_the_slot_forwards_along_the_path() -> None:
    motion, trace = moving(predecessor=DIAGONAL), diagonal()
    motion.step_on(trace, trace.travelled_m, CLOSER, DIAGONAL, 0.5, DT)
    fast = (0.5 + DEFAULT.separation_rate_max_mps) * cos(pi / 4)
    assert (motion.vx, motion.vy) == pytest.approx((fast, fast), abs=1e-6)
    assert motion.separation_m == pytest.approx(1.2 - DEFAULT.separation_rate_max_mps * DT)
    assert not motion.settled
    motion.separation_m = CLOSER.separation_m
    motion.step_on(trace, trace.travelled_m, CLOSER, DIAGONAL, 0.5, DT)
    assert motion.settled


def test_on_a_trace_an_offset_is_added_to_the_place_on_the_path() -> None:
    motion, trace = moving(predecessor=DIAGONAL), diagonal()
    motion.step_on(trace, trace.travelled_m, BEHIND, DIAGONAL, 0.5, DT)
    x, y = motion.x, motion.y
    motion.hang_at(x + 0.3, y - 0.2)
    motion.step_on(trace, trace.travelled_m, BEHIND, DIAGONAL, 0.5, DT)
    assert (motion.x, motion.y) == pytest.approx((x + 0.3, y - 0.2), abs=1e-9)


def test_a_reset_ends_a_blend_and_takes_the_bearing_of_a_full_turn() -> None:
    motion = moving()
    motion.step(CLOSER, Pose2D(), Twist(0.5, 0.3), DT)
    motion.hang_at(5.0, 5.0)
    motion.reset(Slot(2, 0.8, -2.0 * pi / 3.0), Pose2D(1.0, 0.0, 0.2))
    assert (motion.separation_m, motion.phi) == (0.8, pytest.approx(4.0 * pi / 3.0))
    assert (motion.chi, motion.chi_rate, motion.offset_x, motion.offset_y) == (0.2, 0.0, 0.0, 0.0)
