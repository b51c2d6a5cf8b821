"""What a follower makes of its predecessor's messages: now, a while ago, and along its path."""

from __future__ import annotations

from math import cos, hypot, sin
from random import Random

import pytest

from lfa.agents.following.predecessor import Predecessor, Sighting
from lfa.agents.formation.pose_history import SPACING_M, PoseHistory, arc_length
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc
from lfa.protocol.messages.consensus import NO_TERM, Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import PoseStamped

DT = 0.02
ARC = Twist(0.5, 0.4)


def _message(stamp: float, pose: Pose2D, twist: Twist = ARC, incarnation: int = 1) -> PoseStamped:
    header = Header("robot1", incarnation, 0, stamp)
    return PoseStamped(header, pose.x, pose.y, 0.0, pose.theta, twist, 0.0, Role.LEADER, NO_TERM)


def _drive(
    predecessor: Predecessor, *, delay_s: float, jitter_s: float = 0.0, loss: float = 0.0, clock_s: float = 0.0
) -> list[float]:
    """Distance [m] of the sighting from the truth of `predecessor.delay_s` ago, 30 s on an arc; times are exact."""
    chance = Random(4)
    in_flight: list[tuple[float, PoseStamped]] = []
    errors = []
    for n in range(1500):
        now = n * DT
        if chance.random() >= loss:
            message = _message(now - clock_s, along_arc(Pose2D(), ARC, now))
            in_flight.append((now + delay_s + jitter_s * chance.random(), message))
        due = sorted((a for a in in_flight if a[0] <= now), key=lambda a: a[0])
        in_flight = [a for a in in_flight if a[0] > now]
        for at, message in due:
            predecessor.heard(message, at)
            predecessor.clock.reported(delay_s - clock_s, at)
        sighting = predecessor.at(now)
        if sighting is not None and now > 5.0:
            true = along_arc(Pose2D(), ARC, now - predecessor.delay_s)
            errors.append(hypot(sighting.pose.x - true.x, sighting.pose.y - true.y))
    return errors


@pytest.mark.parametrize("clock_s", [0.0, 3.0, 864000.0])
def test_dead_reckoning_on_an_arc_leaves_no_lag_at_any_clock_offset(clock_s: float) -> None:
    assert max(_drive(Predecessor(1), delay_s=0.1, clock_s=clock_s)) < 1e-6


@pytest.mark.parametrize("mode", ["velocity", "pose"])
def test_the_buffer_gives_the_state_of_delta_ago_under_jitter_and_loss(mode: str) -> None:
    """Section 5.2: 100 ms + 0-40 ms, 10 % loss, delta = 220 ms."""
    predecessor = Predecessor(1, mode=mode, delay_s=0.22)  # type: ignore[arg-type]
    assert max(_drive(predecessor, delay_s=0.1, jitter_s=0.04, loss=0.1)) < 5e-4


def test_an_automatic_delay_covers_the_worst_message_and_two_losses() -> None:
    predecessor = Predecessor(1, delay_s=None)
    _drive(predecessor, delay_s=0.1, jitter_s=0.04, loss=0.1)
    assert 0.16 < predecessor.delay_s < 0.2


def test_a_state_older_than_the_newest_message_has_no_age_and_a_silent_predecessor_ages() -> None:
    predecessor = Predecessor(1, delay_s=0.1)
    for n in range(50):
        predecessor.heard(_message(n * DT, along_arc(Pose2D(), ARC, n * DT)), n * DT)
    sighting = predecessor.at(0.98)
    assert sighting is not None
    assert sighting.age_s == 0.0
    sighting = predecessor.at(2.08)
    assert sighting is not None
    assert sighting.age_s == pytest.approx(1.0)


def test_nothing_is_known_before_the_first_message() -> None:
    assert Predecessor(1).at(1.0) is None


def test_a_new_life_starts_a_new_epoch_and_an_old_one_is_refused() -> None:
    predecessor = Predecessor(1)
    predecessor.heard(_message(5.0, Pose2D(), STILL), 5.0)
    assert predecessor.heard(_message(1.0, Pose2D(3.0, 0.0, 0.0), STILL, incarnation=2), 5.1)
    sighting = predecessor.at(5.1)
    assert sighting is not None
    assert (sighting.epoch, sighting.pose.x) == (1, 3.0)
    assert not predecessor.heard(_message(5.2, Pose2D(), STILL), 5.2)
    assert predecessor.refused == 1


def test_a_teleport_starts_a_new_epoch_after_two_messages() -> None:
    predecessor = Predecessor(1)
    for n in range(10):
        predecessor.heard(_message(n * DT, Pose2D(), STILL), n * DT)
    assert not predecessor.heard(_message(0.2, Pose2D(9.0, 0.0, 0.0), STILL), 0.2)
    assert predecessor.heard(_message(0.22, Pose2D(9.0, 0.0, 0.0), STILL), 0.22)
    sighting = predecessor.at(0.22)
    assert sighting is not None
    assert (sighting.epoch, sighting.pose.x) == (1, 9.0)


# --- the trace ----------------------------------------------------------------------------------------------


def _traced(twist: Twist, seconds: float) -> tuple[PoseHistory, Pose2D]:
    trace, pose = PoseHistory(4.0), Pose2D()
    for n in range(int(seconds / DT) + 1):
        pose = along_arc(Pose2D(), twist, n * DT)
        trace.add(pose)
    return trace, pose


def test_the_point_k_behind_lies_on_the_driven_circle() -> None:
    trace, pose = _traced(ARC, 12.0)
    point = trace.at(trace.travelled_m - 1.2)
    true = along_arc(pose, Twist(-0.5, -0.4), 1.2 / 0.5)
    assert hypot(point.x - true.x, point.y - true.y) < 1e-6
    assert point.theta == pytest.approx(true.theta, abs=1e-6)
    assert point.curvature == pytest.approx(0.8, rel=1e-3)


def test_before_the_first_point_the_path_goes_on_straight() -> None:
    trace, _ = _traced(Twist(0.5, 0.0), 0.5)
    point = trace.at(trace.travelled_m - 1.2)
    assert (point.x, point.y) == pytest.approx((-0.95, 0.0))


def test_reversing_takes_the_path_back() -> None:
    trace, pose = _traced(ARC, 6.0)
    for n in range(1, 101):
        trace.add(along_arc(pose, Twist(-0.5, -0.4), n * DT))
    assert trace.travelled_m == pytest.approx(2.0, abs=1e-6)
    point = trace.at(trace.travelled_m - 1.0)
    true = along_arc(Pose2D(), ARC, 2.0)
    assert hypot(point.x - true.x, point.y - true.y) < 1e-6


def test_reversing_beyond_the_kept_path_begins_it_anew() -> None:
    trace, pose = _traced(Twist(0.5, 0.0), 60.0)
    for n in range(1, 1401):
        trace.add(along_arc(pose, Twist(-0.5, 0.0), n * DT))
    point = trace.at(trace.travelled_m - 0.8)
    assert (point.x, point.y) == pytest.approx((30.0 - 14.0 - 0.8, 0.0), abs=0.2)
    turned = Pose2D(16.0, 0.0, 2.0)
    for n in range(1, 101):
        trace.add(along_arc(turned, Twist(0.5, 0.0), n * DT))
    point, true = trace.at(trace.travelled_m - 0.8), along_arc(turned, Twist(0.2, 0.0), 1.0)
    assert hypot(point.x - true.x, point.y - true.y) < 0.05, "the path that it has driven since"


def test_a_trace_keeps_a_bounded_number_of_points() -> None:
    trace, _ = _traced(Twist(1.0, 0.1), 200.0)
    assert len(trace._s) <= 2.0 * 4.0 / SPACING_M + 2


def test_arc_length_is_signed_and_exact() -> None:
    for way in (0.7, -0.7):
        end = along_arc(Pose2D(1.0, 2.0, 3.0), Twist(way, 0.9), 1.0)
        assert arc_length(Pose2D(1.0, 2.0, 3.0), end) == pytest.approx(way, abs=1e-12)


def test_a_follower_that_closes_over_a_dead_robot_keeps_its_path() -> None:
    """The new predecessor's trace begins at the old one's end, joined straight."""
    old, pose = _traced(ARC, 6.0)
    behind = old.at(old.travelled_m - 0.5)
    predecessor = Predecessor(1, trace=old)
    ahead = Pose2D(pose.x + 1.2 * cos(pose.theta), pose.y + 1.2 * sin(pose.theta), pose.theta)
    predecessor.heard(_message(1.0, ahead, STILL), 1.0)
    sighting = predecessor.at(1.0)
    assert isinstance(sighting, Sighting)
    point = sighting.trace.at(sighting.travelled_m - 1.7)
    assert hypot(point.x - behind.x, point.y - behind.y) < 0.02


@pytest.mark.parametrize("mode", ["velocity", "pose"])
@pytest.mark.parametrize("phase_s", [0.0, 0.007, -1e-9])
def test_the_buffers_velocity_carries_its_pose_over_the_coming_period(mode: str, phase_s: float) -> None:
    """Section 5.2: G = exp(-delta s) only if a follower that drives this velocity stays on the delayed path."""
    predecessor = Predecessor(1, mode=mode, delay_s=0.1)  # type: ignore[arg-type]
    pose = Pose2D()
    for n in range(100):
        twist = Twist(0.5 + 0.3 * sin(0.1 * n), 0.2)
        predecessor.heard(_message(n * DT, pose, twist), n * DT)
        pose = along_arc(pose, twist, DT)
    now = 1.9 + phase_s
    here, after = predecessor.at(now), predecessor.at(now + DT)
    assert here is not None
    assert after is not None
    driven = along_arc(here.pose, here.twist, DT)
    assert hypot(driven.x - after.pose.x, driven.y - after.pose.y) < 2e-5
