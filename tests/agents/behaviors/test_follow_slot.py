"""A follower whose predecessor rests between it and its slot is barred: it plans a way past it."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import pytest

from lfa.agents.behaviors.follow_slot import BARS_SHARE, RESTS_MPS, _bars
from lfa.agents.following.predecessor import Sighting
from lfa.agents.following.swung_slot import OUT_S
from lfa.agents.formation.pose_history import PoseHistory
from lfa.agents.navigator import Navigator
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import STILL, Point, Pose2D, Twist, in_base
from lfa.protocol.messages.consensus import NO_TERM, Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import PoseStamped
from lfa.protocol.mission import Mission

HERE = Pose2D(3.0, 1.0, 0.5)


def seen(x: float, y: float, mps: float = 0.0) -> Sighting:
    """Return a sighting of the predecessor `x`, `y` [m] off the robot, at `mps` [m/s]."""
    twist = Twist(mps, 0.0) if mps else STILL
    return Sighting(1, 1, Pose2D(HERE.x + x, HERE.y + y), twist, 0.0, 0.0, 0.0, PoseHistory(5.0))


@pytest.mark.parametrize("turn", [0.0, 2.0, -2.5])
@pytest.mark.parametrize(
    ("off_rad", "barred"), [(0.0, True), (pi / 3 - 0.02, True), (pi / 3 + 0.02, False), (pi, False)]
)
def test_a_slot_beyond_a_predecessor_at_rest_is_barred(turn: float, off_rad: float, barred: bool) -> None:
    assert cos(pi / 3) == pytest.approx(BARS_SHARE)
    ahead = seen(0.5 * cos(turn), 0.5 * sin(turn))
    slot = ahead.pose.x + cos(turn + off_rad), ahead.pose.y + sin(turn + off_rad)
    assert _bars(ahead, slot, HERE) is barred


@pytest.mark.parametrize("mps", [2.0 * RESTS_MPS, -2.0 * RESTS_MPS])
def test_a_predecessor_that_drives_bars_nothing(mps: float) -> None:
    assert not _bars(seen(0.5, 0.0, mps), (HERE.x + 1.5, HERE.y), HERE)


class Behind:
    """Robot 3, which stands 1 m from its slot, on which there is a post; its predecessor rests at the origin."""

    def __init__(self) -> None:
        self._navigator = Navigator(3, Mission((1, 2, 3)), TeamState())
        self._now = 0.0

    def slot_after(self, seconds: float, robot: int) -> Point:
        """Return its slot in `map` after so many seconds behind `robot`."""
        self._navigator.follow_robot(robot, 1)
        ahead = self._navigator.predecessor
        assert ahead is not None
        slot = self._navigator.formation.slot_of(3)
        x, y = slot.separation_m * cos(slot.phi), slot.separation_m * sin(slot.phi)
        pose = Pose2D(x - 1.0, y)
        post = in_base(pose, (x + 0.05, y))
        for _ in range(round(seconds / 0.1)):
            self._now += 0.1
            message = PoseStamped(
                Header(f"robot{robot}", 1, 0, self._now), 0.0, 0.0, 0.0, 0.0, STILL, 0.0, Role.LEADER, NO_TERM
            )
            ahead.heard(message, self._now)
            self._navigator._follow_slot.step([post], pose, STILL, STILL, 0.1, self._now, stuck=False)
        place = self._navigator.follower.readout.slot_map
        return place.x, place.y


def test_a_slot_that_was_swung_behind_one_predecessor_is_not_swung_behind_the_next_one() -> None:
    robot = Behind()
    asked = robot.slot_after(1.0, 1)
    swung = robot.slot_after(OUT_S + 3.0, 1)
    assert hypot(swung[0] - asked[0], swung[1] - asked[1]) > 0.2
    again = robot.slot_after(6.0, 2)
    assert hypot(again[0] - asked[0], again[1] - asked[1]) < 0.05
