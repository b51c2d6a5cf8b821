"""A robot that something holds at rest still knows where it means to drive, and gets on."""

from __future__ import annotations

import pytest

from lfa.deploy.bench.driving.one_run import complaint, driven, loaded
from lfa.deploy.run.simulate import measure
from lfa.world.description.load import load


@pytest.mark.parametrize("gap_m", [0.005, 0.012, 0.019])
def test_a_leader_that_begins_with_its_nose_at_a_post_gets_past_it(gap_m: float) -> None:
    post = f"world.obstacles=[{{center_m=[{0.15 + gap_m + 0.05}, 0.0], radius_m=0.05}}]"
    sets = [post, "mission.leading.route_m=[[0.0, 0.0], [4.0, 0.0]]", "world.start=[0.0, 0.0, 0.0]"]
    summary = measure(load("straight", [*sets, "time_limit_s=40.0"], 1), 1).summary
    found = summary.outcome, [robot.contacts for robot in summary.robots]
    options = " ".join(f"--set '{one}'" for one in sets)
    assert found == ("goal_reached", [0]), (
        f"{summary.reason}; reproduce: lfa sim straight --robots 1 --seed 1 {options}"
    )


FACE_TO_FACE = """
title = "face to face"
time_limit_s = 25.0
[mission]
robots = [1, 2]
[mission.formation]
separation_m = 1.0
side = "column"
[mission.leading]
route_m = [[1.0, 0.0]]
[world]
starts = [[0.95, 0.0, 0.0], [1.6, 0.0, 3.1415]]
"""


def test_a_follower_gets_past_a_predecessor_that_rests_between_it_and_its_slot() -> None:
    """The law keeps its distance there, and led it aside by hundredths of a metre a second."""
    with driven(loaded("face_to_face", FACE_TO_FACE), 1) as done:
        assert complaint(done.summary) is None
