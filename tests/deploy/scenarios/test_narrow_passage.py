"""A robot whose body is a polygon passes where its circle does not: 5 cm beside its sides are enough."""

from pathlib import Path

import pytest

from lfa.deploy.bench import barn
from lfa.deploy.bench.driving.one_run import complaint, loaded
from lfa.deploy.run.simulate import run
from lfa.protocol.errors import Refused

GAP_M = 0.53
"""Width [m] of the passage: a Jackal is 0.43 m wide, and turns in a circle of 0.666 m."""
HALF_M = 0.5 * GAP_M
SCENARIO = f"""title = "narrow passage"
time_limit_s = 60
[mission]
robots = [1]
[mission.leading]
motion = "explore"
route_m = [[0.0, 0.0], [6.0, 0.0]]
[world]
start = [0.0, 0.0, 0.0]
walls_m = [[-2.0, -2.0, 8.0, -2.0], [8.0, -2.0, 8.0, 2.0], [8.0, 2.0, -2.0, 2.0], [-2.0, 2.0, -2.0, -2.0],
           [3.0, -2.0, 3.0, -{HALF_M}], [3.0, -{HALF_M}, 3.3, -{HALF_M}], [3.3, -{HALF_M}, 3.3, -2.0],
           [3.0, 2.0, 3.0, {HALF_M}], [3.0, {HALF_M}, 3.3, {HALF_M}], [3.3, {HALF_M}, 3.3, 2.0]]
"""


def test_a_jackal_drives_through_a_passage_narrower_than_its_circle_without_contact(tmp_path: Path) -> None:
    scenario = loaded("passage", SCENARIO, barn.JACKAL)
    assert complaint(run(scenario, 1, tmp_path / "run").summary) is None


def test_a_jackal_with_noise_that_comes_aslant_drives_squarely_through_the_passage(tmp_path: Path) -> None:
    """It had not come through within a minute: each of its run-ups led it in aslant again."""
    aslant = SCENARIO.replace("[[0.0, 0.0], [6.0, 0.0]]", "[[0.0, 1.2], [6.0, -1.0]]").replace("2.0", "2.5")
    scenario = loaded("passage", aslant.replace("[0.0, 0.0, 0.0]", "[0.0, 1.2, 0.0]"), (*barn.JACKAL, *barn.NOISE))
    assert complaint(run(scenario, 8, tmp_path / "run").summary) is None


def test_a_round_robot_as_large_as_its_circle_is_not_sent_there() -> None:
    with pytest.raises(Refused, match="can be reached, walls part it"):
        loaded("passage", SCENARIO, ["mission.radius_m=0.333"])
