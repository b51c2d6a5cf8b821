"""SE(2): arcs, frames and angles."""

from math import cos, isclose, pi, sin

from hypothesis import given
from hypothesis import strategies as st

from lfa.protocol.geometry import Pose2D, Twist, along_arc, between, compose, distance, inverse, places_along, wrap

angle = st.floats(-50.0, 50.0)
place = st.floats(-100.0, 100.0)
poses = st.builds(Pose2D, place, place, angle.map(wrap))
twists = st.builds(Twist, st.floats(-2.0, 2.0), st.floats(-3.0, 3.0))


def near(a: Pose2D, b: Pose2D, tolerance: float = 1e-9) -> bool:
    return distance(a, b) < tolerance and abs(wrap(a.theta - b.theta)) < tolerance


@given(angle)
def test_wrapped_angles_lie_in_one_turn_and_mean_the_same(a: float) -> None:
    assert -pi < wrap(a) <= pi
    assert isclose(cos(wrap(a)), cos(a), abs_tol=1e-9)
    assert isclose(sin(wrap(a)), sin(a), abs_tol=1e-9)


@given(poses, poses)
def test_between_undoes_compose(a: Pose2D, b: Pose2D) -> None:
    assert near(between(a, compose(a, b)), b, 1e-7)


@given(poses)
def test_a_pose_and_its_inverse_are_the_identity(a: Pose2D) -> None:
    assert near(compose(a, inverse(a)), Pose2D(), 1e-7)


@given(poses, twists, st.lists(st.floats(0.0, 6.0), max_size=9))
def test_places_along_an_arc_are_those_of_its_poses_to_the_last_bit(a: Pose2D, twist: Twist, at: list[float]) -> None:
    poses_there = [along_arc(a, twist, later) for later in at]
    assert places_along(a, twist, at) == [(there.x, there.y) for there in poses_there]


@given(poses, twists, st.floats(0.001, 1.0))
def test_an_arc_is_the_same_in_one_step_and_in_many(a: Pose2D, twist: Twist, duration: float) -> None:
    """Equation (1) integrated exactly does not depend on the step."""
    stepped = a
    for _ in range(50):
        stepped = along_arc(stepped, twist, duration / 50)
    assert near(stepped, along_arc(a, twist, duration), 1e-9)


def test_a_full_circle_returns() -> None:
    start = Pose2D(1.0, 2.0, 0.3)
    assert near(along_arc(start, Twist(0.5, 0.25), 2 * pi / 0.25), start)
