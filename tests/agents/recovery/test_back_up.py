"""Backing out of a trap the way that the robot came."""

from math import hypot

from lfa.agents.recovery.back_up import OUT_M, BackUp
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc

DT = 0.02
AHEAD = Twist(0.4, 0.2)
BESIDE = [(0.05 * n, side * 0.4) for n in range(-60, 30) for side in (-1.0, 1.0)]


def driven_in() -> tuple[BackUp, Pose2D]:
    """A robot that came along a bend."""
    back_up, pose = BackUp(), Pose2D()
    for _ in range(300):
        pose = along_arc(pose, AHEAD, DT)
        back_up.keep(pose)
    back_up.begin(pose)
    return back_up, pose


def test_it_goes_back_as_it_came_until_it_is_out() -> None:
    back_up, pose = driven_in()
    came_from, trap = along_arc(Pose2D(), AHEAD, 2.0), pose
    for _ in range(2000):
        twist = back_up.step([], pose, 0.15)
        if twist is None:
            break
        assert twist.linear_x < 0.0
        pose = along_arc(pose, twist, DT)
    assert not back_up.under_way
    assert back_up.trap == (trap.x, trap.y)
    assert hypot(pose.x - trap.x, pose.y - trap.y) > 0.9 * OUT_M
    assert hypot(pose.x - came_from.x, pose.y - came_from.y) < 0.2


def test_it_waits_while_somebody_stands_behind() -> None:
    back_up, pose = driven_in()
    for _ in range(50):
        assert back_up.step([(-0.20, 0.0)], pose, 0.15) == STILL
    assert back_up.under_way


def test_walls_beside_the_way_do_not_hold_it() -> None:
    back_up = BackUp()
    for n in range(30):
        back_up.keep(Pose2D(0.1 * n, 0.0, 0.0))
    back_up.begin(Pose2D(2.9, 0.0, 0.0))
    twist = back_up.step(BESIDE, Pose2D(2.9, 0.0, 0.0), 0.15)
    assert twist is not None
    assert twist.linear_x < 0.0
