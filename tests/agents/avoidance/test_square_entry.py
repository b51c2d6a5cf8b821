"""A polygon comes squarely, along its middle line, into a passage narrower than its circle."""

from __future__ import annotations

import pytest

from lfa.agents.avoidance.square_entry import KEPT_S, PATIENCE_S, SquareEntry
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, in_base
from lfa.protocol.mission import Limits

RADIUS_M, HALF_WIDTH_M, DT = 0.333, 0.215, 0.05
GAP = [(2.5, side * (0.265 + 0.03 * n)) for n in range(40) for side in (1.0, -1.0)]
SPEED_MPS, TURN_RADPS = 0.4, 1.0


class Robot:
    """Robot whose planned route leads straight through the gap, and on to (5, 0)."""

    def __init__(self, pose: Pose2D, walls: list[Point]) -> None:
        self.entry = SquareEntry(RADIUS_M, HALF_WIDTH_M, Limits())
        self.pose, self.walls, self.now = pose, walls, 0.0

    def route(self, s: float) -> Point:
        """Return the point `s` [m] ahead: aslant to (2.6, 0.05), and along y = 0.05 from there."""
        x, y = in_base(self.pose, (2.6, 0.05) if self.pose.x < 2.3 else (9.0, 0.05))
        far_m = max((x * x + y * y) ** 0.5, 1e-6)
        return s * x / far_m, s * y / far_m

    def step(self, wanted: Twist | None = None) -> Twist:
        """Drive on for a control step; return the twist."""
        x, y = self.route(0.35)
        pursuit = Twist(SPEED_MPS, SPEED_MPS * 2.0 * y / (x * x + y * y))
        points = [in_base(self.pose, point) for point in self.walls]
        near = [(px, py) for px, py in points if px * px + py * py < 4.0]
        _, twist = self.entry.lead(
            near, self.pose, self.route, pursuit if wanted is None else wanted, SPEED_MPS, TURN_RADPS, self.now
        )
        self.pose, self.now = along_arc(self.pose, twist, DT), self.now + DT
        return twist


@pytest.mark.parametrize("start", [Pose2D(0.0, 1.0, -0.4), Pose2D(0.5, -1.2, 0.6), Pose2D(1.4, 0.3, 0.0)])
def test_at_the_passage_a_robot_that_came_aslant_is_on_its_middle_line_and_square_to_it(start: Pose2D) -> None:
    robot = Robot(start, GAP)
    while robot.pose.x < 2.5 - RADIUS_M:
        robot.step()
        assert robot.now < PATIENCE_S
    assert abs(robot.pose.y) < 0.03
    assert abs(robot.pose.theta) < 0.1


def test_a_robot_that_comes_squarely_does_not_stop_before_the_passage() -> None:
    robot = Robot(Pose2D(0.0, 0.0, 0.0), GAP)
    while robot.pose.x < 2.5:
        assert robot.step().linear_x > 0.09
    assert robot.now < 2.5 / SPEED_MPS + 1.0


def test_where_something_stands_at_the_gate_the_way_is_the_routes() -> None:
    robot = Robot(Pose2D(0.0, 1.0, -0.4), [*GAP, (1.8, 0.05)])
    assert [robot.step(Twist(0.3, 0.1)) for _ in range(20)] == [Twist(0.3, 0.1)] * 20


@pytest.mark.parametrize("wanted", [STILL, Twist(-0.1, 0.0)])
def test_a_robot_that_rests_or_backs_goes_on_so(wanted: Twist) -> None:
    assert Robot(Pose2D(1.0, 0.6, -0.4), GAP).step(wanted) == wanted


def test_a_passage_that_is_no_longer_seen_is_given_up() -> None:
    robot = Robot(Pose2D(1.0, 0.6, -0.4), GAP)
    assert robot.step(Twist(0.3, 0.1)) != Twist(0.3, 0.1)
    robot.walls = []
    for _ in range(round(KEPT_S / DT) + 2):
        robot.step(Twist(0.0, 0.01))
    assert robot.step(Twist(0.3, 0.1)) == Twist(0.3, 0.1)


def test_a_robot_that_does_not_come_to_the_gate_goes_on_without() -> None:
    robot, start = Robot(Pose2D(1.0, 0.6, -0.4), GAP), Pose2D(1.0, 0.6, -0.4)
    for _ in range(round(PATIENCE_S / DT) + 2):
        robot.step()
        robot.pose = start
    assert robot.step(Twist(0.3, 0.1)) == Twist(0.3, 0.1)


def test_the_time_for_which_a_robot_rests_is_none_on_its_way_to_the_gate() -> None:
    """It waits for its team, or another part of it leads meanwhile."""
    robot = Robot(Pose2D(1.0, 0.6, -0.4), GAP)
    entered = robot.step()
    for _ in range(round(PATIENCE_S / DT) + 2):
        robot.step(STILL)
    robot.pose = Pose2D(1.0, 0.6, -0.4)
    assert robot.step(Twist(0.3, 0.1)) == entered
