"""What a follower gives its controller: direction, guard, trace; when it restarts it; and what it counts."""

from __future__ import annotations

from math import hypot, pi

import pytest

from lfa.agents.config import DEFAULT
from lfa.agents.following.controller import Reference
from lfa.agents.following.follower import ASTRAY_M, LEAVE_M, Follower, State
from lfa.agents.following.predecessor import Sighting
from lfa.agents.formation.pose_history import PoseHistory
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Limits

BEHIND = Slot(2, 1.2, pi)
AT = Pose2D(10.0, 5.0, 0.0)
"""Place of the predecessor, off the origin and off the axes."""


class Noting:
    """Controller that keeps its references, and stays where it is."""

    def __init__(self) -> None:
        self.references: list[Reference] = []
        self.resets = 0

    def reset(self, own_pose: Pose2D, own_twist: Twist) -> None:
        self.resets += 1

    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
        self.references.append(reference)
        return STILL


def pair() -> tuple[Follower, Noting]:
    noting = Noting()
    return Follower(DEFAULT, Limits(), noting, radius_m=0.15), noting


def sighted(pose: Pose2D = AT, speed: float = 0.0, trace: PoseHistory | None = None, robot: int = 1) -> Sighting:
    trace = trace or PoseHistory(4.0)
    return Sighting(robot, 0, pose, Twist(speed, 0.0), 0.0, 0.0, trace.travelled_m, trace)


def behind(gap_m: float) -> Pose2D:
    return Pose2D(AT.x - gap_m, AT.y, 0.0)


def test_the_direction_is_forwards_at_first_and_switches_with_hysteresis() -> None:
    follower, noting = pair()
    for speed in (0.0, -0.1, 0.0, 0.01, 0.03):
        follower.step(sighted(speed=speed), BEHIND, behind(1.2), STILL)
    assert [reference.direction for reference in noting.references] == [1, -1, -1, -1, 1]


def test_a_follower_that_starts_apart_is_guarded_and_one_that_overlaps_only_once_it_is_out() -> None:
    for gap_m, guarded in ((0.31, True), (0.29, False)):
        follower, noting = pair()
        follower.step(sighted(), BEHIND, behind(gap_m), STILL)
        assert noting.references[-1].guarded is guarded
    follower.step(sighted(), BEHIND, behind(0.99 * DEFAULT.d_min_m), STILL)
    assert not noting.references[-1].guarded
    follower.step(sighted(), BEHIND, behind(1.01 * DEFAULT.d_min_m), STILL)
    assert noting.references[-1].guarded
    follower.step(sighted(), BEHIND, behind(0.29), STILL)
    assert noting.references[-1].guarded


def test_an_idle_robot_restarts_its_controller_only_when_it_is_far_from_its_slot() -> None:
    for off_m, restarts in ((0.9 * ASTRAY_M, 0), (1.1 * ASTRAY_M, 3)):
        follower, noting = pair()
        for _ in range(3):
            follower.step(sighted(), BEHIND, behind(1.2 + off_m), STILL)
        assert follower.readout.state is State.STAND
        assert noting.resets == 1 + restarts


def test_a_standing_robot_starts_again_when_its_slot_has_moved_or_its_target_drives() -> None:
    follower, _ = pair()
    follower.step(sighted(), BEHIND, behind(1.2), STILL)
    assert follower.readout.state is State.STAND
    follower.step(sighted(), BEHIND, behind(1.2 + 0.9 * LEAVE_M), STILL)
    assert follower.readout.state is State.STAND
    follower.step(sighted(), BEHIND, behind(1.2 + 1.1 * LEAVE_M), STILL)
    assert follower.readout.state is State.FOLLOW
    follower.step(sighted(), BEHIND, behind(1.2), STILL)
    follower.step(sighted(speed=0.1), BEHIND, behind(1.2), STILL)
    assert follower.readout.state is State.FOLLOW
    follower.step(sighted(), BEHIND, behind(1.2 + 1.5 * LEAVE_M), STILL)
    assert follower.readout.state is State.STAND, "idle where it is: the error counts from here"


def test_on_a_trace_the_slot_lies_on_the_path_and_not_on_a_line() -> None:
    trace = PoseHistory(6.0)
    for n in range(101):
        trace.add(Pose2D(0.0, 0.05 * n, pi / 2))  # 5 m to the left ...
    for n in range(1, 11):
        trace.add(Pose2D(0.05 * n, 5.0, 0.0))  # ... then half a metre ahead
    follower, noting = pair()
    for _ in range(3):
        follower.step(
            sighted(Pose2D(0.5, 5.0, 0.0), 0.5, trace), BEHIND, Pose2D(0.0, 4.0, pi / 2), STILL, on_trace=True
        )
    reference = noting.references[-1]
    assert hypot(reference.x, reference.y - 4.3) < 0.05
    assert (reference.vx, reference.vy) == pytest.approx((0.0, 0.5), abs=0.05)


def test_another_predecessor_moves_the_target_by_nothing_at_first() -> None:
    follower, noting = pair()
    for _ in range(3):
        follower.step(sighted(), BEHIND, behind(1.2), STILL)
    before = noting.references[-1]
    follower.step(sighted(Pose2D(AT.x + 1.0, AT.y - 1.0, 0.0), robot=3), BEHIND, behind(1.2), STILL)
    after = noting.references[-1]
    assert (after.x, after.y) == pytest.approx((before.x, before.y), abs=0.01)
    for _ in range(2000):
        follower.step(sighted(Pose2D(AT.x + 1.0, AT.y - 1.0, 0.0), robot=3), BEHIND, behind(1.2), STILL)
    last = noting.references[-1]
    assert (last.x, last.y) == pytest.approx((AT.x - 0.2, AT.y - 1.0), abs=1e-6)


def test_only_bad_inputs_are_counted_as_refused() -> None:
    follower, _ = pair()
    follower.step(sighted(), BEHIND, behind(1.2), STILL)
    assert follower.refused == 0
    follower.step(sighted(Pose2D(float("nan"), 0.0, 0.0)), BEHIND, behind(1.2), STILL)
    follower.step(sighted(), BEHIND, Pose2D(float("inf"), 0.0, 0.0), STILL)
    follower.step(sighted(), BEHIND, behind(1.2), STILL, dt=1.0)
    assert follower.refused == 3
