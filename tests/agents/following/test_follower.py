"""Special motions of control.md 2.3: one follower behind an ideal leader, 20 ms of latency."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, hypot, pi, sin

import pytest

from lfa.agents.config import DEFAULT, SHARP, Gains
from lfa.agents.following.controller import Law
from lfa.agents.following.follower import Follower, State
from lfa.agents.following.predecessor import Sighting
from lfa.agents.formation.pose_history import PoseHistory
from lfa.deploy.bench.harness.chain import Chain, Setup, in_slots
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, distance
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Limits

DT = 0.02
LEFT = Slot(2, 1.2, 2 * pi / 3)
RIGHT = Slot(2, 1.2, -2 * pi / 3)
COLUMN = Slot(2, 1.2, pi)
LIMITS = Limits()
Lead = Callable[[float], Twist]


def _ramp(t: float, top: float = 0.5) -> float:
    return min(top, 0.5 * t)


def _straight(t: float) -> Twist:
    return Twist(_ramp(t), 0.0)


class Log:
    """What happened to the only follower of a chain, one entry a control period."""

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self.t: list[float] = []
        self.slot_m: list[float] = []
        self.distance_m: list[float] = []
        self.heading_rad: list[float] = []
        self.apart_m: list[float] = []
        self.twists: list[Twist] = []

    def run(self, lead: Lead, seconds: float) -> Log:
        end = self.chain.time_s + seconds - 0.5 * DT
        while self.chain.time_s < end:
            self.t.append(self.chain.time_s)
            self.apart_m.append(distance(self.chain.leader_pose, self.chain.robots[0].pose))
            self.chain.step(lead(self.chain.time_s))
            errors = self.chain.errors(0)
            self.slot_m.append(errors.slot_m)
            self.distance_m.append(abs(errors.distance_m))
            self.heading_rad.append(abs(errors.heading_rad))
            self.twists.append(self.chain.robots[0].twist)
        return self

    def last_outside(self, metres: float, since: float = 0.0) -> float:
        """Seconds after `since` until the slot error stays below `metres`."""
        return max((t - since for t, e in zip(self.t, self.slot_m, strict=True) if e > metres), default=0.0)

    def assert_smooth(self) -> None:
        """No jump beyond the acceleration limits."""
        before = STILL
        for t, twist in zip(self.t, self.twists, strict=True):
            assert abs(twist.linear_x - before.linear_x) <= LIMITS.a_max_mps2 * DT + 1e-9, f"at {t} s"
            assert abs(twist.angular_z - before.angular_z) <= LIMITS.alpha_max_radps2 * DT + 1e-9, f"at {t} s"
            before = twist


def _one(slot: Slot = LEFT, starts: list[Pose2D] | None = None, **settings: object) -> Log:
    return Log(Chain(Setup((slot,), **settings), starts))  # type: ignore[arg-type]


@pytest.mark.parametrize(("gains", "limit_s"), [(DEFAULT, 4.5), (SHARP, 3.2)])
def test_from_the_papers_start_F1_is_within_5_cm_in_time(gains: Gains, limit_s: float) -> None:
    log = _one(starts=[Pose2D(), Pose2D()], gains=gains).run(_straight, 20.0)
    assert log.last_outside(0.05) <= limit_s
    assert max(log.distance_m) <= 1.2 + 1e-9
    log.assert_smooth()


def test_when_the_leader_stops_the_follower_stands_within_1_6_s_without_a_bump() -> None:
    def lead(t: float) -> Twist:
        return Twist(min(_ramp(t), max(0.0, 0.5 - 0.5 * (t - 20.0))), 0.0)

    log = _one(heading_filter_m=0.36).run(lead, 26.0)
    moving = [t for t, w in zip(log.t, log.twists, strict=True) if max(abs(w.linear_x), abs(w.angular_z)) > 1e-3]
    assert max(moving) - 21.0 <= 1.6
    assert max(log.slot_m[1000:]) < 0.01
    assert log.slot_m[-1] <= 2.2e-3
    assert log.twists[-1] == STILL
    assert log.chain.robots[0].follower.readout.state is State.STAND


def test_behind_a_reversing_leader_the_follower_backs_up_without_turning_round() -> None:
    def lead(t: float) -> Twist:
        return Twist(max(-0.2, min(_ramp(t), 0.5 - 0.5 * (t - 15.0))), 0.1 if t > 18.0 else 0.0)

    log = _one(COLUMN, heading_filter_m=0.36).run(lead, 25.0)
    assert max(log.slot_m[600:]) < 0.06
    assert max(log.heading_rad[600:]) < 0.35
    assert min(w.linear_x for w in log.twists) > -LIMITS.v_reverse_max_mps - 1e-9
    log.assert_smooth()


def test_while_the_leader_turns_in_place_the_follower_stays_and_then_comes_round() -> None:
    def lead(t: float) -> Twist:
        if t < 10.0:
            return Twist(min(_ramp(t), max(0.0, 0.5 * (10.0 - t))), 0.0)
        return Twist(0.0, pi / 4) if t < 12.0 else Twist(_ramp(t - 12.0), 0.0)

    log = _one(heading_filter_m=0.36).run(lead, 10.0)
    before = log.chain.robots[0].pose
    log.run(lead, 2.0)
    assert distance(before, log.chain.robots[0].pose) < 0.01
    log.run(lead, 13.0)
    assert log.last_outside(0.05, since=12.0) <= 6.0


@pytest.mark.parametrize("heading_filter_m", [0.0, 0.36])
def test_left_to_right_to_column_keeps_apart_recovers_and_never_jumps(heading_filter_m: float) -> None:
    log = _one(heading_filter_m=heading_filter_m).run(_straight, 10.0)
    for slot in (RIGHT, COLUMN):
        begun = log.chain.time_s
        log.chain.robots[0].slot = slot
        log.run(_straight, 12.0)
        end = in_slots(log.chain.leader_pose, (slot,))[0]
        assert distance(end, log.chain.robots[0].pose) < 0.01
        # The judge's own slot swings likewise: the error against it is what the law adds.
        assert log.last_outside(0.05, since=begun) <= 8.0
    assert min(log.apart_m) > 1.1
    log.assert_smooth()


def test_a_jump_of_the_slot_by_a_change_of_predecessor_is_blended_in_time() -> None:
    """The target goes on from where it was: 0.94 m at 0.3 m/s."""
    follower = Follower(DEFAULT, LIMITS, Law(DEFAULT, LIMITS))
    ahead, own, twist = Pose2D(), Pose2D(-1.2, 0.0, 0.0), STILL
    trace, moved_at, fastest, settled = PoseHistory(4.0), 250, 0.0, 0.0
    for n in range(800):
        robot = 1 if n < moved_at else 5
        if n == moved_at:
            ahead = Pose2D(ahead.x + 0.8, ahead.y + 0.5, 0.0)
        sighting = Sighting(robot, 0, ahead, Twist(0.5, 0.0), 0.0, 0.0, 0.0, trace)
        before = twist
        twist = follower.step(sighting, COLUMN, own, twist, DT)
        assert abs(twist.linear_x - before.linear_x) <= LIMITS.a_max_mps2 * DT + 1e-9
        error = hypot(ahead.x - 1.2 - own.x, ahead.y - own.y)
        if n > moved_at:
            fastest = max(fastest, twist.linear_x)
            settled = n * DT if error > 0.05 else settled
        ahead, own = along_arc(ahead, Twist(0.5, 0.0), DT), along_arc(own, twist, DT)
    assert settled - moved_at * DT <= 4.0
    assert fastest <= 0.85


@pytest.mark.parametrize(("outage_s", "peak_m", "recovery_s"), [(0.2, 1e-3, 0.1), (0.5, 0.02, 1.0), (1.0, 0.35, 2.5)])
def test_an_outage_is_bridged_by_dead_reckoning_then_by_standing(
    outage_s: float, peak_m: float, recovery_s: float
) -> None:
    def lead(t: float) -> Twist:
        return Twist(_ramp(t), 0.25 * _ramp(t))

    log = _one(COLUMN).run(lead, 20.0)
    predecessor = log.chain.robots[0].predecessor
    heard, predecessor.heard = predecessor.heard, lambda message, at: False  # type: ignore[method-assign, assignment]
    log.run(lead, outage_s)
    predecessor.heard = heard  # type: ignore[method-assign]
    over = log.chain.time_s
    log.run(lead, 10.0)
    assert max(log.slot_m[900:]) <= peak_m
    assert log.last_outside(0.05, since=over) <= recovery_s
    log.assert_smooth()


def test_when_the_predecessor_falls_silent_the_follower_brakes_along_its_path_and_holds() -> None:
    follower = Follower(DEFAULT, LIMITS, Law(DEFAULT, LIMITS))
    twist, trace = STILL, PoseHistory(4.0)
    for n in range(200):
        ahead = along_arc(Pose2D(1.2, 0.0, 0.0), Twist(0.5, 0.0), n * DT)
        own = Pose2D(ahead.x - 1.2, 0.0, 0.0)
        twist = follower.step(Sighting(1, 0, ahead, Twist(0.5, 0.0), 0.0, 0.0, 0.0, trace), COLUMN, own, twist, DT)
    twists = []
    for _ in range(40):
        twists.append(follower.step(Sighting(1, 0, ahead, twist, 0.6, 0.0, 0.0, trace), COLUMN, own, twist, DT))
    assert twists[0].linear_x == pytest.approx(0.48, abs=1e-3)
    assert twists[-1] == STILL
    assert follower.readout.state is State.HOLD
    assert follower.step(None, COLUMN, own, STILL, DT) == STILL


def test_a_slot_nearer_than_d_min_is_not_taken_the_guard_wins() -> None:
    def lead(t: float) -> Twist:
        return Twist(min(_ramp(t), max(0.0, 0.5 - 0.5 * (t - 15.0))), 0.0)

    log = _one(COLUMN).run(lead, 8.0)
    log.chain.robots[0].slot = Slot(2, 0.40, pi)
    log.run(lead, 12.0)
    assert min(log.apart_m) > DEFAULT.d_min_m - 0.01


def test_after_an_override_the_law_is_rejoined_without_a_jump() -> None:
    log = _one(COLUMN).run(_straight, 10.0)
    chain, robot = log.chain, log.chain.robots[0]
    away = Twist(0.3, 0.8)
    real = robot.follower.step
    robot.follower.step = lambda *a, **k: away  # type: ignore[method-assign]
    robot.follower.overridden(away)
    for _ in range(40):
        chain.step(_straight(chain.time_s))
    robot.follower.step = real  # type: ignore[method-assign]
    robot.follower.rejoin(robot.pose, robot.twist)
    log.twists, log.t, log.slot_m = [], [], []
    begun, last = chain.time_s, robot.twist
    log.run(_straight, 12.0)
    first = log.twists[0]
    assert abs(first.linear_x - last.linear_x) <= LIMITS.a_max_mps2 * DT + 1e-9
    assert abs(first.angular_z - last.angular_z) <= LIMITS.alpha_max_radps2 * DT + 1e-9
    assert log.last_outside(0.05, since=begun) <= 5.0
    assert max(abs(w.linear_x) for w in log.twists) < 0.95


def test_a_robot_that_comes_back_at_an_angle_does_not_swing_past_its_slot() -> None:
    log = _one(heading_filter_m=0.36).run(_straight, 8.0)
    chain, robot = log.chain, log.chain.robots[0]
    robot.pose = Pose2D(robot.pose.x - 0.3, robot.pose.y + 0.6, -0.9)  # after a detour to the left
    robot.follower.rejoin(robot.pose, robot.twist)
    past_m = 0.0
    while chain.time_s < 14.0:
        log.run(_straight, DT)
        past_m = max(past_m, chain.leader_pose.y + 1.2 * sin(2 * pi / 3) - robot.pose.y)
    assert past_m < 0.02
    assert log.last_outside(0.05, since=8.0) <= 3.0


def test_saturation_keeps_the_ratio_of_v_and_omega() -> None:
    follower = Follower(DEFAULT, Limits(a_max_mps2=1e6, alpha_max_radps2=1e6), _Wants(Twist(3.0, 3.0)))
    sighting = Sighting(1, 0, Pose2D(3.0, 0.0, 0.0), Twist(0.5, 0.0), 0.0, 0.0, 0.0, PoseHistory(4.0))
    twist = follower.step(sighting, COLUMN, Pose2D(), STILL, DT)
    assert (twist.linear_x, twist.angular_z) == pytest.approx((1.0, 1.0))
    follower = Follower(DEFAULT, Limits(a_max_mps2=1e6, alpha_max_radps2=1e6), _Wants(Twist(-0.6, 1.0)))
    twist = follower.step(sighting, COLUMN, Pose2D(), STILL, DT)
    assert (twist.linear_x, twist.angular_z) == pytest.approx((-0.3, 0.5))


class _Wants:
    """A controller that always wants the same."""

    def __init__(self, twist: Twist) -> None:
        self._twist = twist

    def reset(self, own_pose: Pose2D, own_twist: Twist) -> None:
        pass

    def step(self, reference: object, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
        return self._twist


@pytest.mark.parametrize("controller", ["law", "kanayama", "headway"])
def test_every_shipped_controller_keeps_a_follower_in_its_slot(controller: str) -> None:
    def lead(t: float) -> Twist:
        return Twist(_ramp(t), 0.3 * sin(0.2 * t) * _ramp(t))

    start = in_slots(Pose2D(), (LEFT,))[0]
    log = _one(LEFT, [Pose2D(), Pose2D(start.x - 0.1, start.y + 0.1, 0.2)], controller=controller).run(lead, 40.0)
    allowed = 0.3 * 0.6 + 0.02 if controller == "headway" else 0.02
    assert max(log.slot_m[1000:]) < allowed
    assert cos(max(log.heading_rad[1000:])) > 0.98


def test_the_papers_observer_in_the_loop_follows_a_wave() -> None:
    def lead(t: float) -> Twist:
        return Twist(_ramp(t), 0.3 * sin(0.2 * t) * _ramp(t))

    log = _one(LEFT, mode="paper", extrapolation_max_s=0.0).run(lead, 40.0)
    assert max(log.slot_m[1000:]) < 0.05
