"""Whatever comes in, what goes to `cmd_vel` is finite and within the limits, and what was refused is counted."""

from __future__ import annotations

from math import isfinite, pi

from hypothesis import given, settings
from hypothesis import strategies as st

from lfa.agents.config import DEFAULT
from lfa.agents.following.controller import Law
from lfa.agents.following.follower import Follower
from lfa.agents.following.plugin import make_controller
from lfa.agents.following.predecessor import Predecessor
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc
from lfa.protocol.messages.consensus import NO_TERM, Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import PoseStamped, Slot
from lfa.protocol.mission import Following, Limits

LIMITS = Limits()
DT = 0.02
anything = st.one_of(
    st.floats(-20.0, 20.0), st.floats(), st.sampled_from([0.0, -0.0, 1e-300, 1e300, float("nan"), float("inf")])
)
sane = st.floats(-2.0, 2.0)


@st.composite
def messages(draw: st.DrawFn) -> tuple[float, PoseStamped]:
    """(lateness, message): mostly plausible, at times anything at all."""
    number = anything if draw(st.integers(0, 3)) == 0 else sane
    stamp_off = draw(number)
    header = Header("robot1", draw(st.sampled_from([1, 1, 1, 2])), 0, stamp_off)
    x, y, theta, v, omega = (draw(number) for _ in range(5))
    return draw(st.floats(0.0, 0.3)), PoseStamped(
        header, x, y, 0.0, theta, Twist(v, omega), 0.0, Role.FOLLOWER, NO_TERM
    )


@settings(max_examples=150)
@given(
    heard=st.lists(st.one_of(st.none(), messages()), min_size=5, max_size=40),
    times=st.lists(st.floats(-0.05, 0.6), min_size=5, max_size=40),
    own=st.lists(st.builds(Pose2D, anything, anything, anything), min_size=1, max_size=3),
    slot=st.builds(Slot, st.just(2), st.floats(0.4, 5.0), st.floats(-2.0 * pi, 2.0 * pi)),
    name=st.sampled_from(["law", "kanayama", "headway"]),
    mode=st.sampled_from(["velocity", "pose"]),
    delay_s=st.sampled_from([0.0, 0.1, None]),
    on_trace=st.booleans(),
    paper=st.booleans(),
    heading_filter_m=st.sampled_from([0.0, 0.36]),
)
def test_no_input_makes_a_command_that_is_not_finite_or_breaks_a_limit(
    heard: list[tuple[float, PoseStamped] | None],
    times: list[float],
    own: list[Pose2D],
    slot: Slot,
    name: str,
    mode: str,
    delay_s: float | None,
    on_trace: bool,
    paper: bool,
    heading_filter_m: float,
) -> None:
    controller = make_controller(Following(controller=name), DEFAULT, LIMITS)
    follower = Follower(DEFAULT, LIMITS, controller, heading_filter_m=heading_filter_m, paper_observer=paper)
    predecessor = Predecessor(1, mode=mode, delay_s=delay_s)  # type: ignore[arg-type]
    now, pose, before = 100.0, Pose2D(), STILL
    for n, item in enumerate(heard):
        dt = times[n % len(times)]
        now += dt
        if item is not None:
            late, message = item
            header = message.header
            stamped = Header(header.sender, header.incarnation, n, now - late + header.stamp)
            predecessor.heard(
                PoseStamped(
                    stamped, message.x, message.y, 0.0, message.theta, message.twist, 0.0, Role.FOLLOWER, NO_TERM
                ),
                now,
            )
        here = own[n % len(own)] if n % 7 == 3 else pose
        twist = follower.step(predecessor.at(now), slot, here, before, dt, on_trace=on_trace)
        assert isfinite(twist.linear_x), (n, item)
        assert isfinite(twist.angular_z), (n, item)
        # The limit of speed is kept to 1e-9, which spares a limit of 0 the division; here with what is rounded.
        assert -LIMITS.v_reverse_max_mps - 2e-9 <= twist.linear_x <= LIMITS.v_max_mps + 2e-9
        assert abs(twist.angular_z) <= LIMITS.omega_max_radps + 1e-9
        used = min(0.1, max(0.001, dt))
        assert abs(twist.linear_x - before.linear_x) <= LIMITS.a_max_mps2 * used + 1e-9
        assert abs(twist.angular_z - before.angular_z) <= LIMITS.alpha_max_radps2 * used + 1e-9
        readout = follower.readout
        assert all(isfinite(value) for value in (readout.chi, readout.heading, readout.error_m, readout.phi))
        pose, before = along_arc(pose, twist, min(0.1, max(0.0, dt))), twist


def _message(stamp: float, x: float, v: float = 0.5) -> PoseStamped:
    header = Header("robot1", 1, 0, stamp)
    return PoseStamped(header, x, 0.0, 0.0, 0.0, Twist(v, 0.0), 0.0, Role.LEADER, NO_TERM)


def test_a_message_with_nan_or_absurd_values_is_refused_counted_and_changes_nothing() -> None:
    predecessor = Predecessor(1)
    for n in range(20):
        assert predecessor.heard(_message(n * DT, 0.01 * n), n * DT)
    before = predecessor.at(0.4)
    nan = float("nan")
    for stamp, x, v in ((0.4, nan, 0.5), (0.4, 1e9, 0.5), (0.4, 0.2, nan), (0.4, 0.2, 1e3), (nan, 0.2, 0.5)):
        assert not predecessor.heard(_message(stamp, x, v), 0.4)
    assert predecessor.refused == 5
    assert predecessor.at(0.4) == before


def test_a_stamp_from_the_future_after_the_estimated_offset_is_refused_and_counted() -> None:
    predecessor = Predecessor(1)
    for n in range(20):
        predecessor.heard(_message(n * DT + 1000.0, 0.01 * n), n * DT)
    assert not predecessor.heard(_message(1005.0, 0.2), 0.4)
    assert predecessor.refused == 1
    sighting = predecessor.at(0.4)
    assert sighting is not None
    assert abs(sighting.pose.x - 0.2) < 1e-6


def test_own_time_running_backwards_and_a_missing_period_are_counted_and_driven_through() -> None:
    follower = Follower(DEFAULT, LIMITS, Law(DEFAULT, LIMITS))
    predecessor = Predecessor(1)
    predecessor.heard(_message(1.0, 1.2), 1.0)
    slot = Slot(2, 1.2, pi)
    for dt in (DT, -1.0, 0.0, float("nan"), 5.0):
        twist = follower.step(predecessor.at(1.0), slot, Pose2D(), STILL, dt)
        assert isfinite(twist.linear_x)
    assert follower.refused == 4


def test_an_own_pose_that_is_not_finite_brakes() -> None:
    follower = Follower(DEFAULT, LIMITS, Law(DEFAULT, LIMITS))
    predecessor = Predecessor(1)
    predecessor.heard(_message(1.0, 1.7), 1.0)
    slot = Slot(2, 1.2, pi)
    for _ in range(20):
        fast = follower.step(predecessor.at(1.0), slot, Pose2D(), STILL, DT)
    slower = follower.step(predecessor.at(1.0), slot, Pose2D(float("nan"), 0.0, 0.0), fast, DT)
    assert 0.0 < slower.linear_x < fast.linear_x
    assert follower.refused == 1
