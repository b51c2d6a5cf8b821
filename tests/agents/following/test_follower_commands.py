"""The twist that a follower sends: limits, braking, steps of a wrong length, resting, and what it starts again from."""

from __future__ import annotations

from math import pi

import pytest

from lfa.agents.config import DEFAULT
from lfa.agents.following.controller import SLOT_SPEED_MIN_MPS, Reference
from lfa.agents.following.follower import (
    DT_MAX_S,
    DT_MIN_S,
    IDLE_MPS,
    IDLE_RADPS,
    SLUGGISH_MPS,
    SLUGGISH_RADPS,
    SLUGGISH_S,
    STOP_ERROR_M,
    Follower,
    PaperVelocity,
    State,
)
from lfa.agents.following.predecessor import Sighting
from lfa.agents.formation.pose_history import PoseHistory
from lfa.agents.formation.slot_motion import SlotMotion
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Limits

LIMITS = Limits()
DT = 0.02
BEHIND = Slot(2, 1.2, pi)
IN_SLOT = Pose2D(-1.2, 0.0, 0.0)


class Wanting:
    """Controller that always wants `twist`, and keeps its references."""

    def __init__(self, twist: Twist) -> None:
        self.twist = twist
        self.references: list[Reference] = []

    def reset(self, own_pose: Pose2D, own_twist: Twist) -> None:
        pass

    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
        self.references.append(reference)
        return self.twist


def wanting(twist: Twist, **settings: float) -> tuple[Follower, Wanting]:
    controller = Wanting(twist)
    return Follower(DEFAULT, LIMITS, controller, **settings), controller  # type: ignore[arg-type]


def sighted(twist: Twist = STILL, age_s: float = 0.0, delay_s: float = 0.0, pose: Pose2D | None = None) -> Sighting:
    return Sighting(1, 0, pose or Pose2D(), twist, age_s, delay_s, 0.0, PoseHistory(4.0))


@pytest.mark.parametrize(
    ("wanted", "sent"),
    [
        (Twist(0.5, 0.0), Twist(0.02, 0.0)),
        (Twist(-0.2, 0.0), Twist(-0.02, 0.0)),
        (Twist(0.01, 0.02), Twist(0.01, 0.02)),
        (Twist(0.0, 1.0), Twist(0.0, LIMITS.alpha_max_radps2 * DT)),
        (Twist(0.0, -1.0), Twist(0.0, -LIMITS.alpha_max_radps2 * DT)),
    ],
)
def test_from_rest_a_command_changes_by_one_step_of_acceleration(wanted: Twist, sent: Twist) -> None:
    follower, _ = wanting(wanted)
    out = follower.step(sighted(Twist(0.5, 0.0)), BEHIND, IN_SLOT, STILL, DT)
    assert (out.linear_x, out.angular_z) == pytest.approx((sent.linear_x, sent.angular_z))


@pytest.mark.parametrize(("dt", "counted"), [(0.5, DT_MAX_S), (0.0, DT_MIN_S), (-1.0, DT_MIN_S)])
def test_a_step_of_a_wrong_length_counts_as_the_longest_or_the_shortest(dt: float, counted: float) -> None:
    follower, _ = wanting(Twist(0.9, 0.0))
    out = follower.step(sighted(Twist(0.5, 0.0)), BEHIND, IN_SLOT, STILL, dt)
    assert out.linear_x == pytest.approx(LIMITS.a_max_mps2 * counted)
    assert follower.refused == 1


@pytest.mark.parametrize("dt", [DT_MIN_S, DT_MAX_S])
def test_a_step_at_either_bound_is_a_good_one(dt: float) -> None:
    follower, _ = wanting(Twist(0.9, 0.0))
    follower.step(sighted(Twist(0.5, 0.0)), BEHIND, IN_SLOT, STILL, dt)
    assert follower.refused == 0


@pytest.mark.parametrize("last", [Twist(0.5, 0.25), Twist(0.05, 1.5), Twist(-0.2, 0.4), Twist(0.1, -1.0)])
def test_braking_keeps_the_path_and_uses_the_weaker_of_the_two_decelerations(last: Twist) -> None:
    follower, _ = wanting(STILL)
    follower.overridden(last)
    out = follower.step(None, BEHIND, IN_SLOT, last, DT)
    assert out.linear_x * last.angular_z == pytest.approx(out.angular_z * last.linear_x)
    dv, dw = abs(last.linear_x - out.linear_x), abs(last.angular_z - out.angular_z)
    assert max(dv / (LIMITS.a_max_mps2 * DT), dw / (LIMITS.alpha_max_radps2 * DT)) == pytest.approx(1.0)
    assert abs(out.linear_x) < abs(last.linear_x)


def test_braking_ends_at_rest() -> None:
    follower, _ = wanting(STILL)
    follower.overridden(Twist(0.01, 0.01))
    assert follower.step(None, BEHIND, IN_SLOT, STILL, DT) == STILL
    assert follower.readout.state is State.HOLD


def test_a_sighting_is_fresh_up_to_its_greatest_age() -> None:
    for age_s, state in (
        (DEFAULT.dead_reckoning_max_s, State.FOLLOW),
        (DEFAULT.dead_reckoning_max_s + 0.01, State.HOLD),
    ):
        follower, _ = wanting(Twist(0.3, 0.0))
        follower.step(sighted(Twist(0.5, 0.0), age_s), BEHIND, IN_SLOT, STILL, DT)
        assert follower.readout.state is state


@pytest.mark.parametrize(
    ("wanted", "off_m", "rests"),
    [
        (Twist(0.9 * IDLE_MPS, 0.9 * IDLE_RADPS), 0.05, True),
        (Twist(1.1 * IDLE_MPS, 0.0), 0.05, False),
        (Twist(0.0, 1.1 * IDLE_RADPS), 0.05, False),
        (Twist(0.2, 0.5), 0.9 * STOP_ERROR_M, True),
        (Twist(0.2, 0.5), 1.1 * STOP_ERROR_M, False),
    ],
)
def test_behind_a_standing_predecessor_a_robot_rests_in_its_slot_or_where_nothing_brings_it_nearer(
    wanted: Twist, off_m: float, rests: bool
) -> None:
    follower, _ = wanting(wanted)
    out = follower.step(sighted(), BEHIND, Pose2D(-1.2, off_m, 0.0), STILL, DT)
    assert (follower.readout.state is State.STAND) is rests
    assert (out == STILL) is rests
    assert follower.readout.error_m == pytest.approx(off_m)


@pytest.mark.parametrize("twist", [Twist(0.002, 0.0), Twist(-0.002, 0.0), Twist(0.0, 0.002), Twist(0.0, -0.002)])
def test_behind_a_predecessor_that_moves_or_turns_nobody_rests(twist: Twist) -> None:
    follower, _ = wanting(STILL)
    follower.step(sighted(twist), BEHIND, IN_SLOT, STILL, DT)
    assert follower.readout.state is State.FOLLOW


def test_while_its_slot_still_moves_a_robot_blends_and_does_not_rest() -> None:
    follower, _ = wanting(STILL)
    follower.step(sighted(), BEHIND, IN_SLOT, STILL, DT)
    follower.step(sighted(), Slot(2, 0.8, pi), IN_SLOT, STILL, DT)
    assert follower.readout.state is State.BLEND
    assert 0.8 < follower.readout.separation_m < 1.2


def test_behind_a_reversing_predecessor_the_heading_stays_that_of_the_formation() -> None:
    follower, controller = wanting(STILL)
    for speed in (0.5, -0.5):
        follower.step(sighted(Twist(speed, 0.0)), BEHIND, IN_SLOT, STILL, DT)
        assert controller.references[-1].heading == pytest.approx(0.0)
    follower.step(sighted(Twist(-0.5, 0.0), pose=Pose2D(0.0, 0.0, 0.4)), BEHIND, IN_SLOT, STILL, DT)
    assert controller.references[-1].heading == pytest.approx(0.4)


def test_the_heading_of_a_slot_at_rest_is_the_robots_own_at_first() -> None:
    follower, controller = wanting(STILL)
    follower.step(sighted(pose=Pose2D(0.0, 0.0, 1.0)), BEHIND, Pose2D(-1.2, 0.0, 0.3), STILL, DT)
    assert controller.references[-1].heading == 0.3


def test_an_old_reference_is_shifted_ahead_by_the_cruise_speed() -> None:
    follower, controller = wanting(STILL, cruise_mps=0.5)
    follower.step(sighted(Twist(0.5, 0.0), delay_s=0.2), BEHIND, IN_SLOT, STILL, DT)
    assert controller.references[-1].x == pytest.approx(-1.1)


def test_after_an_override_the_target_begins_at_the_robot_and_the_command_at_its_motion() -> None:
    follower, controller = wanting(Twist(0.9, 0.0))
    follower.step(sighted(), BEHIND, IN_SLOT, STILL, DT)
    away, motion = Pose2D(-2.0, 0.7, 0.5), Twist(0.4, 0.1)
    follower.rejoin(away, motion)
    out = follower.step(sighted(Twist(0.5, 0.0)), BEHIND, away, motion, DT)
    assert (controller.references[-1].x, controller.references[-1].y) == pytest.approx((-2.0, 0.7))
    assert out.linear_x == pytest.approx(0.4 + LIMITS.a_max_mps2 * DT)


def test_who_has_not_followed_yet_rejoins_nothing_and_goes_straight_to_its_slot() -> None:
    follower, controller = wanting(STILL)
    follower.rejoin(Pose2D(-2.0, 0.7, 0.5), STILL)
    follower.step(sighted(), BEHIND, Pose2D(-2.0, 0.7, 0.5), STILL, DT)
    assert (controller.references[-1].x, controller.references[-1].y) == pytest.approx((-1.2, 0.0))


def test_a_motion_that_is_no_number_is_taken_for_rest_at_a_rejoin() -> None:
    follower, _ = wanting(Twist(0.9, 0.0))
    follower.rejoin(IN_SLOT, Twist(float("nan"), 0.0))
    assert follower.step(sighted(Twist(0.5, 0.0)), BEHIND, IN_SLOT, STILL, DT).linear_x == pytest.approx(0.02)


def test_what_is_read_out_is_the_slot_with_its_bearing_between_minus_pi_and_pi() -> None:
    follower, _ = wanting(STILL)
    follower.step(sighted(Twist(0.5, 0.1)), Slot(2, 1.2, -2.0 * pi / 3.0), IN_SLOT, STILL, DT)
    readout = follower.readout
    assert readout.phi == pytest.approx(-2.0 * pi / 3.0)
    assert (readout.slot_map.x, readout.slot_map.y) == pytest.approx((-0.6, -1.2 * 3.0**0.5 / 2.0))
    assert readout.chi == 0.0
    assert readout.slot_map.theta == readout.heading


def observed(theta: float, seconds: float = 6.0) -> tuple[PaperVelocity, SlotMotion]:
    """Let a robot with heading `theta` stand while its slot moves at (0.3, -0.2) m/s, seen anew in each step."""
    paper, motion, own = PaperVelocity(), SlotMotion(DEFAULT, LIMITS, 0.0), Pose2D(2.0, -3.0, theta)
    for n in range(round(seconds / DT)):
        motion.x, motion.y, motion.chi_rate = 2.5 + 0.3 * n * DT, -2.8 - 0.2 * n * DT, 0.1
        paper.observe(motion, sighted(), own, STILL, DT)
    return paper, motion


@pytest.mark.parametrize("theta", [0.0, 0.7, -2.0])
def test_the_papers_observer_finds_the_slots_velocity_in_the_map_whatever_the_robots_heading(theta: float) -> None:
    _, motion = observed(theta)
    assert (motion.vx, motion.vy) == pytest.approx((0.3, -0.2), abs=0.01)
    assert motion.chi_rate == 0.0


def test_while_sightings_only_grow_older_the_papers_observer_measures_nothing() -> None:
    paper, motion = observed(0.7)
    place = motion.x, motion.y
    for n in range(1, 26):
        motion.x, motion.y = place[0] + 0.5, place[1] + 0.5  # an extrapolated slot, wherever it is
        paper.observe(motion, sighted(age_s=n * DT), Pose2D(2.0, -3.0, 0.7), STILL, DT)
    assert (motion.vx, motion.vy) == pytest.approx((0.3, -0.2), abs=0.02)
    motion.x, motion.y = place[0] + 0.3 * 26 * DT, place[1] - 0.2 * 26 * DT + 0.3
    paper.observe(motion, sighted(age_s=20 * DT), Pose2D(2.0, -3.0, 0.7), STILL, DT)
    assert motion.vy > -0.1, "a younger one is a measurement, though it is old"


def test_a_reset_of_the_papers_observer_forgets_the_velocity() -> None:
    paper, motion = observed(0.7)
    paper.reset()
    paper.observe(motion, sighted(), Pose2D(2.0, -3.0, 0.7), STILL, DT)
    assert (motion.vx, motion.vy) == pytest.approx((0.0, 0.0), abs=0.05)


def test_a_slot_that_moves_sideways_in_the_map_gives_the_heading_from_its_least_speed_on() -> None:
    for share, heading in ((0.9, 0.3), (1.1, pi / 2)):
        follower, controller = wanting(STILL)
        ahead = Pose2D(0.0, 1.2, pi / 2)
        twist = Twist(share * SLOT_SPEED_MIN_MPS, 0.0)
        follower.step(sighted(twist, pose=ahead), BEHIND, Pose2D(0.0, 0.0, 0.3), STILL, DT)
        assert controller.references[-1].heading == pytest.approx(heading)


def test_an_idle_robot_far_from_its_slot_goes_as_soon_as_its_controller_wants_to() -> None:
    follower, controller = wanting(STILL)
    far = Pose2D(-1.5, 0.0, 0.0)
    follower.step(sighted(), BEHIND, far, STILL, DT)
    assert follower.readout.state is State.STAND
    controller.twist = Twist(0.2, 0.0)
    assert follower.step(sighted(), BEHIND, far, STILL, DT).linear_x > 0.0


def test_a_predecessor_at_no_place_is_none() -> None:
    follower, controller = wanting(Twist(0.3, 0.0))
    assert follower.step(sighted(pose=Pose2D(float("nan"), 0.0, 0.0)), BEHIND, IN_SLOT, STILL, DT) == STILL
    assert follower.readout.state is State.HOLD
    assert controller.references == []


def test_after_a_hold_the_target_begins_at_the_robot() -> None:
    follower, controller = wanting(STILL)
    follower.step(sighted(), BEHIND, IN_SLOT, STILL, DT)
    follower.step(None, BEHIND, IN_SLOT, STILL, DT)
    follower.step(sighted(pose=Pose2D(0.0, 0.0, 0.9)), BEHIND, Pose2D(-1.2, 0.0, 0.4), STILL, DT)
    assert controller.references[-1].heading == 0.4


class Failing(Wanting):
    """Controller that fails in its first step."""

    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
        raise ValueError("no way")


@pytest.mark.parametrize(("name", "shown"), [("carrot", "controller carrot:"), ("", "controller Failing:")])
def test_a_controller_that_fails_is_named_and_the_robot_brakes(name: str, shown: str) -> None:
    follower = Follower(DEFAULT, LIMITS, Failing(STILL), name=name)
    assert follower.step(sighted(Twist(0.5, 0.0)), BEHIND, IN_SLOT, STILL, DT) == STILL
    assert (follower.failure or "").startswith(shown)


def test_a_drive_without_a_reverse_gear_never_goes_back() -> None:
    follower = Follower(DEFAULT, Limits(v_reverse_max_mps=0.0), Wanting(Twist(-0.2, 0.1)))
    out = follower.step(sighted(Twist(-0.5, 0.0)), BEHIND, IN_SLOT, STILL, DT)
    assert out.linear_x == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("wanted", "rests"),
    [
        (Twist(0.9 * SLUGGISH_MPS, -0.9 * SLUGGISH_RADPS), True),
        (Twist(1.1 * SLUGGISH_MPS, 0.0), False),
        (Twist(0.0, 1.1 * SLUGGISH_RADPS), False),
    ],
)
def test_a_robot_that_is_held_off_its_slot_and_turns_to_and_fro_there_rests_after_a_while(
    wanted: Twist, rests: bool
) -> None:
    """At its predecessor's body it turned by 3 degrees a second, and the run did not end."""
    follower, _ = wanting(wanted)
    off = Pose2D(-1.2, 0.2, 0.0)
    for n in range(round(SLUGGISH_S / DT) + 9):
        out = follower.step(sighted(), BEHIND, off, STILL, DT)
        assert follower.readout.state is not State.STAND or n * DT >= SLUGGISH_S - DT
    assert (out == STILL) is rests
    assert (follower.step(sighted(), BEHIND, off, STILL, DT) == STILL) is rests


def test_a_robot_that_comes_nearer_however_slowly_is_not_held_off() -> None:
    follower, _ = wanting(Twist(0.5 * SLUGGISH_MPS, 0.0))
    for n in range(round(2.0 * SLUGGISH_S / DT)):
        off = Pose2D(-1.2, 0.3 - 0.01 * n * DT, 0.0)
        assert follower.step(sighted(), BEHIND, off, STILL, DT) != STILL
