"""A follower whose predecessor rests between it and its slot is barred: it plans a way past it."""

from __future__ import annotations

from math import cos, pi, sin

import pytest

from lfa.agents.behaviors.follow_slot import BARS_SHARE, RESTS_MPS, _bars
from lfa.agents.following.predecessor import Sighting
from lfa.agents.formation.pose_history import PoseHistory
from lfa.protocol.geometry import STILL, Pose2D, Twist

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
