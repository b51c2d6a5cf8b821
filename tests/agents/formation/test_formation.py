"""Slots, orientation requests, curvature limits and blends against control.md sections 2.2, 2.3 and 4."""

from __future__ import annotations

from itertools import pairwise
from math import atan2, cos, hypot, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from lfa.agents.config import DEFAULT
from lfa.agents.formation.formation import (
    Formation,
    check_slot,
    leader_speed_cap,
    leader_speed_floor,
    named,
    paper_phi,
    phi_of,
    radius_min,
    slots_of,
    speed_factors,
)
from lfa.agents.formation.pose_history import PoseHistory
from lfa.agents.formation.slot_motion import SlotMotion
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import STILL, TAU, Pose2D, Twist, along_arc, wrap
from lfa.protocol.messages.consensus import NO_TERM, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import FormationNote, Slot
from lfa.protocol.mission import Following, FormationSpec, Limits, Mission, Side

DT = 0.02
LIMITS = Limits()


def _slots(side: str, followers: int = 3) -> tuple[Slot, ...]:
    return slots_of(named(side, FormationSpec()), range(2, followers + 2))


def test_eq_32_33_corrected_left_and_right_are_mirror_images_behind_the_predecessor() -> None:
    left, right = phi_of("left", pi / 3, 0), phi_of("right", pi / 3, 0)
    assert left == pytest.approx(2.0944, abs=1e-4)
    assert right == pytest.approx(-2.0944, abs=1e-4)
    assert (1.2 * cos(left), 1.2 * sin(left)) == pytest.approx((-0.600, 1.0392), abs=1e-4)
    assert (1.2 * cos(right), 1.2 * sin(right)) == pytest.approx((-0.600, -1.0392), abs=1e-4)


@pytest.mark.parametrize("phi", [0.3, pi / 3, 2.0, 3.0])
def test_eq_32_33_every_branch_lies_behind_and_33_is_the_mirror_image_of_32(phi: float) -> None:
    left, right = paper_phi("left", phi), paper_phi("right", phi)
    assert abs(left) >= pi / 2
    assert wrap(left + right) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("side", "phi", "bearing"),
    [
        ("left", 0.0, pi), ("left", 1.2, pi - 1.2), ("left", 2.0, 2.0 - 1.5 * pi),
        ("right", 1.2, 1.2 - pi), ("right", 2.0, 1.5 * pi - 2.0), ("left", pi, -pi / 2),
        ("zigzag", 1.2, pi - 1.2), ("zigzag", 2.0, 1.5 * pi - 2.0), ("column", 1.2, pi), ("column", 2.0, pi),
    ],
)  # fmt: skip
def test_eq_32_counts_from_the_rear_axis_below_pi_half_and_changes_the_side_above(
    side: Side, phi: float, bearing: float
) -> None:
    assert paper_phi(side, phi) == pytest.approx(bearing)


@pytest.mark.parametrize("phi", [pi / 2, -0.1, 3.2])
def test_eq_32_33_are_refused_at_pi_half_where_they_jump_and_out_of_their_range(phi: float) -> None:
    with pytest.raises(Refused, match="pi/2"):
        paper_phi("left", phi)


def test_zigzag_alternates_and_column_is_straight_behind() -> None:
    assert [round(s.phi, 4) for s in _slots("zigzag")] == [2.0944, -2.0944, 2.0944]
    assert [s.phi for s in _slots("column")] == [pi] * 3


def test_an_operators_unknown_formation_is_refused_with_the_known_ones() -> None:
    with pytest.raises(Refused, match="left, right, column, zigzag"):
        named("diamond", FormationSpec())


@pytest.mark.parametrize(
    "slot",
    [
        Slot(2, 0.2, pi),
        Slot(2, float("nan"), pi),
        Slot(2, float("inf"), pi),
        Slot(2, 1.2, float("nan")),
        Slot(2, 1.2, 9.0),
        Slot(2, 1.2, -9.0),
        Slot(2, 1.2, 0.3),
        Slot(2, 1.2, 1.4),
        Slot(2, -1.2, pi),
        Slot(2, 101.0, pi),
    ],
)
def test_slots_that_no_robot_can_take_are_refused(slot: Slot) -> None:
    with pytest.raises(Refused, match="robot2"):
        check_slot(slot, 0.4)


@pytest.mark.parametrize("slot", [Slot(2, 0.4, pi / 2), Slot(2, 100.0, -pi / 2), Slot(2, 1.2, TAU - pi)])
def test_the_last_slots_that_a_robot_can_take_are_taken(slot: Slot) -> None:
    assert check_slot(slot, 0.4) is slot


def _note(term: Term, number: int, *slots: Slot) -> FormationNote:
    return FormationNote(Header("robot1", 1, 0, 0.0), term, number, slots)


def test_a_mission_names_the_slots_of_all_followers_and_their_least_separation() -> None:
    formation = Formation.of(Mission((1, 2, 3), radius_m=0.3, following=Following(trace=True)))
    assert [robot for robot in range(5) if formation.is_named(robot)] == [2, 3]
    assert formation.trace
    assert formation.slot_of(4) == Slot(4, FormationSpec().separation_m, pi), "straight behind, if nobody named one"
    assert not formation.request(_note(Term(1, 1, 1), 0, Slot(2, 0.69, pi)))
    assert formation.request(_note(Term(1, 1, 1), 1, Slot(2, 0.71, pi)))


def test_the_first_request_counts_whatever_its_term() -> None:
    assert Formation(FormationSpec(), (1, 2), 0.4).request(_note(NO_TERM, 0, Slot(2, 1.0, pi)))


def test_a_request_brings_its_side_and_whether_followers_keep_to_the_path() -> None:
    formation = Formation(FormationSpec(), (1, 2), 0.4)
    for number, (said, side, trace) in enumerate([("right", "right", True), ("diamond", "", False)]):
        note = structs.replace(_note(Term(1, 1, 1), number, Slot(2, 1.0, pi)), side=said, trace=trace)
        assert formation.request(note)
        assert (formation.side, formation.trace) == (side, trace)


def test_the_highest_term_and_number_counts_and_a_bad_request_changes_nothing() -> None:
    formation = Formation(FormationSpec(), (1, 2, 3), 0.4)
    assert formation.request(_note(Term(2, 1, 1), 5, Slot(2, 1.0, pi)))
    assert not formation.request(_note(Term(2, 1, 1), 5, Slot(2, 1.1, pi)))
    assert not formation.request(_note(Term(1, 3, 1), 9, Slot(2, 1.1, pi)))
    assert not formation.request(_note(Term(3, 1, 1), 0, Slot(2, 1.5, pi), Slot(3, 0.1, pi)))
    assert formation.refused == 1
    assert formation.slot_of(2) == Slot(2, 1.0, pi)
    assert formation.slot_of(3).phi == pytest.approx(2 * pi / 3)
    assert formation.request(_note(Term(3, 1, 1), 0, Slot(2, 1.5, pi)))
    assert formation.slot_of(2).separation_m == 1.5


@pytest.mark.parametrize(
    ("side", "followers", "radius_m"), [("left", 1, 1.84), ("left", 3, 5.3), ("zigzag", 3, 2.06), ("column", 3, 1.68)]
)
def test_smallest_leader_radius_for_0_8_over_0_5_mps(side: str, followers: int, radius_m: float) -> None:
    """Section 2.2."""
    assert radius_min(_slots(side, followers), 0.8 / 0.5) == pytest.approx(radius_m, rel=0.01)


def test_speeds_in_a_left_turn_of_the_left_echelon() -> None:
    """Section 2.2: R = 4 m: 0.38, 0.26, 0.15 m/s behind a leader at 0.5."""
    speeds = [0.5 * f for f in speed_factors(_slots("left"), 0.25)]
    assert speeds == pytest.approx([0.38, 0.26, 0.15], abs=0.01)


@pytest.mark.parametrize(("n", "factor"), [(10, 2.1), (50, 4.4), (100, 6.1)])
def test_speed_factor_of_a_rigid_column(n: int, factor: float) -> None:
    """Section 2.2: sqrt(1 + N k^2 / R^2) at R = 2 m."""
    assert speed_factors(_slots("column", n), 0.5)[-1] == pytest.approx(factor, abs=0.05)


def test_the_leader_is_capped_so_that_no_follower_exceeds_nine_tenths_of_v_max() -> None:
    slots = _slots("left")
    for curvature in (-0.5, -0.2, 0.0, 0.2):
        cap = leader_speed_cap(slots, curvature, LIMITS)
        assert max([1.0, *speed_factors(slots, curvature)]) * cap <= 0.9 * LIMITS.v_max_mps + 1e-9
    assert leader_speed_cap((), 0.0, Limits(v_max_mps=0.8)) == pytest.approx(0.8)
    assert leader_speed_cap(slots, 0.0, Limits(v_max_mps=0.8)) == pytest.approx(0.9 * 0.8)
    assert leader_speed_cap((), 4.0, LIMITS) == pytest.approx(0.9 * LIMITS.omega_max_radps / 4.0)
    assert leader_speed_floor(slots, 0.25) == pytest.approx(0.05 / speed_factors(slots, 0.25)[-1])


@given(st.floats(-0.45, 0.45), st.sampled_from(["left", "right", "zigzag", "column"]))
def test_speed_factors_are_those_of_driven_circles(curvature: float, side: str) -> None:
    """f is |r'| / v of slots that hang on slots, each heading along its own motion."""
    pose, twist = Pose2D(), Twist(0.5, 0.5 * curvature)
    expected = []
    for slot in _slots(side):
        angle = pose.theta + slot.phi
        x, y = slot.separation_m * cos(angle), slot.separation_m * sin(angle)
        vx = twist.linear_x * cos(pose.theta) - twist.angular_z * y
        vy = twist.linear_x * sin(pose.theta) + twist.angular_z * x
        speed = hypot(vx, vy)
        expected.append(speed / 0.5)
        pose = Pose2D(pose.x + x, pose.y + y, atan2(vy, vx))
        twist = Twist(speed, twist.angular_z)
    if min(expected) > 0.05:
        assert speed_factors(_slots(side), curvature) == pytest.approx(expected, rel=1e-6)


def _swing(start: Slot, end: Slot, twist: Twist = STILL) -> list[tuple[float, float, float, float]]:
    """(x, y, vx, vy) of the target in each step of a change of slot."""
    motion = SlotMotion(DEFAULT, LIMITS, 0.0)
    pose = Pose2D()
    motion.reset(start, pose)
    steps = []
    for _ in range(900):
        motion.step(end, pose, twist, DT)
        steps.append((motion.x, motion.y, motion.vx, motion.vy))
        pose = along_arc(pose, twist, DT)
    assert motion.settled
    return steps


def test_a_change_of_side_swings_through_the_rear_at_the_commanded_distance() -> None:
    steps = _swing(Slot(2, 1.2, 2 * pi / 3), Slot(2, 1.2, -2 * pi / 3))
    assert all(hypot(x, y) == pytest.approx(1.2, abs=1e-9) for x, y, _, _ in steps)
    assert all(x < -0.59 for x, _, _, _ in steps)
    assert steps[-1][:2] == pytest.approx((-0.6, -1.0392), abs=1e-4)
    swinging = [n for n, s in enumerate(steps) if hypot(s[2], s[3]) > 1e-9]
    assert len(swinging) * DT == pytest.approx((2 * pi / 3) / 0.35, abs=0.1)


@pytest.mark.parametrize("twist", [STILL, Twist(0.5, 0.1), Twist(0.8, -0.2)])
def test_the_targets_velocity_is_its_derivative_and_stays_below_nine_tenths_of_v_max(twist: Twist) -> None:
    steps = _swing(Slot(2, 1.2, 2 * pi / 3), Slot(2, 0.8, -2 * pi / 3), twist)
    for (x0, y0, vx, vy), (x1, y1, _, _) in pairwise(steps):
        assert hypot((x1 - x0) / DT - vx, (y1 - y0) / DT - vy) < 0.02
        assert hypot(vx, vy) <= max(0.9 * LIMITS.v_max_mps, hypot(twist.linear_x, 0.0) + 0.25) + 1e-6


def test_the_filtered_heading_does_not_move_while_the_predecessor_turns_in_place() -> None:
    """Section 2.3: with L_chi > 0 the slot stays; with L_chi = 0 it orbits."""
    for heading_filter_m, moved in ((0.36, 0.0), (0.0, 1.2 * pi / 2)):
        motion = SlotMotion(DEFAULT, LIMITS, heading_filter_m)
        pose, slot = Pose2D(), Slot(2, 1.2, 2 * pi / 3)
        motion.reset(slot, pose)
        way, last = 0.0, None
        for _ in range(101):
            motion.step(slot, pose, Twist(0.0, pi / 4), DT)
            if last is not None:
                way += hypot(motion.x - last[0], motion.y - last[1])
            last = motion.x, motion.y
            pose = along_arc(pose, Twist(0.0, pi / 4), DT)
        assert way == pytest.approx(moved, abs=1e-3)


def test_beside_begins_at_a_quarter_turn() -> None:
    assert check_slot(Slot(2, 1.2, pi / 2), 0.4) == Slot(2, 1.2, pi / 2)
    for phi in (0.99 * pi / 2, -0.99 * pi / 2, 1.2, 0.0):
        with pytest.raises(Refused, match="beside or behind"):
            check_slot(Slot(2, 1.2, phi), 0.4)


@pytest.mark.parametrize("phi", [0.3, 1.2])
def test_the_papers_input_means_the_first_follower(phi: float) -> None:
    assert paper_phi("zigzag", phi) == paper_phi("left", phi) == phi_of("left", phi, 0)
    assert paper_phi("zigzag", phi + pi / 2) == phi_of("left", phi, 0)


def test_a_target_that_hangs_at_a_place_stays_there_and_a_reset_lets_it_go() -> None:
    slot, predecessor = Slot(2, 1.2, pi), Pose2D(3.0, 2.0, 0.0)
    motion = SlotMotion(DEFAULT, LIMITS, 0.0)
    motion.reset(slot, predecessor)
    motion.step(slot, predecessor, STILL, DT)
    assert (motion.x, motion.y) == pytest.approx((1.8, 2.0))
    motion.hang_at(1.0, 1.0)
    motion.step(slot, predecessor, STILL, DT)
    assert (motion.x, motion.y) == pytest.approx((1.0, 1.0))
    motion.step(slot, predecessor, STILL, DT)
    assert 1.0 < motion.x < 1.05 and 1.0 < motion.y < 1.05
    motion.reset(slot, predecessor)
    motion.step(slot, predecessor, STILL, DT)
    assert (motion.x, motion.y) == pytest.approx((1.8, 2.0))


def test_a_filtered_heading_turns_as_far_as_the_predecessor_has_driven() -> None:
    slot, turned = Slot(2, 1.2, pi), Pose2D(0.0, 0.0, 0.5)
    motion = SlotMotion(DEFAULT, LIMITS, 2.0)
    motion.reset(slot, Pose2D())
    motion.step(slot, turned, Twist(0.4, 0.0), DT)
    assert motion.chi == 0.0
    assert motion.chi_rate == pytest.approx(0.4 / 2.0 * 0.5)
    motion.step(slot, turned, Twist(0.4, 0.0), DT)
    assert motion.chi == pytest.approx(0.1 * DT)


def test_on_a_bend_of_the_trace_the_slot_turns_with_it() -> None:
    trace, radius_m, slot = PoseHistory(4.0), 2.0, Slot(2, 1.2, pi)
    for n in range(201):
        trace.add(along_arc(Pose2D(), Twist(0.01, 0.01 / radius_m), float(n)))
    predecessor = along_arc(Pose2D(), Twist(2.0, 2.0 / radius_m), 1.0)
    motion = SlotMotion(DEFAULT, LIMITS, 0.0)
    motion.reset(slot, predecessor)
    motion.step_on(trace, trace.travelled_m, slot, predecessor, 0.4, DT)
    expected = along_arc(Pose2D(), Twist(0.8, 0.8 / radius_m), 1.0)
    assert (motion.x, motion.y) == pytest.approx((expected.x, expected.y), abs=0.02)
    assert hypot(motion.vx, motion.vy) == pytest.approx(0.4)
    assert motion.chi_rate == pytest.approx(0.4 / radius_m, rel=0.1)


def test_a_blend_never_makes_the_slot_faster_than_its_share_of_the_drive() -> None:
    slot, wide = Slot(2, 1.2, pi), Slot(2, 2.4, pi / 2)
    motion = SlotMotion(DEFAULT, LIMITS, 0.0)
    motion.reset(slot, Pose2D())
    limit = DEFAULT.slot_speed_share * LIMITS.v_max_mps
    x, speeds = 0.0, []
    for _ in range(400):
        x += 0.6 * DT
        motion.step(wide, Pose2D(x, 0.0, 0.0), Twist(0.6, 0.0), DT)
        speeds.append(hypot(motion.vx, motion.vy))
    assert 0.61 < max(speeds) <= limit + 0.05
    assert (motion.separation_m, motion.phi) == pytest.approx((2.4, pi / 2))


def test_a_filtered_heading_rests_where_the_predecessor_keeps_its_own() -> None:
    motion, predecessor = SlotMotion(DEFAULT, LIMITS, 2.0), Pose2D(0.0, 0.0, 0.5)
    motion.reset(Slot(2, 1.2, pi), predecessor)
    motion.step(Slot(2, 1.2, pi), predecessor, Twist(0.4, 0.0), DT)
    assert (motion.chi, motion.chi_rate) == (0.5, 0.0)


def test_on_a_trace_an_old_reference_is_shifted_ahead_along_the_path() -> None:
    trace, slot = PoseHistory(4.0), Slot(2, 1.2, pi)
    for n in range(101):
        trace.add(Pose2D(0.03 * n, 0.0, 0.0))
    motion = SlotMotion(DEFAULT, LIMITS, 0.0)
    motion.reset(slot, Pose2D(3.0, 0.0, 0.0))
    motion.lead_m = 0.2
    motion.step_on(trace, trace.travelled_m, slot, Pose2D(3.0, 0.0, 0.0), 0.4, DT)
    assert (motion.x, motion.y) == pytest.approx((2.0, 0.0), abs=0.02)
