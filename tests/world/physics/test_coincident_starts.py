"""The paper's start, all robots at (0, 0, 0): nothing to each other until they were apart, then bodies again."""

from __future__ import annotations

import pytest

from lfa.protocol.errors import Refused
from lfa.protocol.geometry import STILL, Twist
from lfa.world.description.load import draw, load
from lfa.world.physics.rigid_bodies import Physics

ORIGIN = "world.starts=[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]"
AHEAD, BACK = Twist(0.5, 0.0), Twist(-0.3, 0.0)


def test_starts_in_each_other_are_refused_unless_the_scenario_says_so() -> None:
    with pytest.raises(Refused, match=r"starts at least 0.3 m apart"):
        load("straight", [ORIGIN])
    assert load("straight", [ORIGIN, "world.starts_coincide=true"]).world.starts_coincide


def test_robots_that_start_in_each_other_part_freely_and_collide_when_they_meet_again() -> None:
    bodies = Physics(draw(load("paper_fig11"), 0))
    others = [STILL] * 3
    touches = [touch for _ in range(200) for touch in bodies.step([AHEAD, *others])]
    assert touches == []
    assert bodies.poses[0].x == pytest.approx(0.875, abs=0.01)
    assert all(pose.x == 0.0 for pose in bodies.poses[1:])
    touches = [touch for _ in range(400) for touch in bodies.step([BACK, *others])]
    assert {touch.robot for touch in touches} >= {0, 1}
    assert bodies.poses[0].x > 0.1
