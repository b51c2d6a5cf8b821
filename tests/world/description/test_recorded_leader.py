"""The trajectory of a recorded robot as that of a scenario's leader."""

from __future__ import annotations

from math import cos, hypot, sin
from pathlib import Path

import msgspec
import pytest

from lfa.deploy.ros import bag
from lfa.deploy.run import simulate
from lfa.protocol.errors import Refused
from lfa.protocol.mission_checks import check_mission
from lfa.world.description.load import draw, load
from lfa.world.description.recorded_leader import STEP_M, STEP_S, with_leader


def mrclam(path: Path) -> Path:
    """Write a robot that drives a curve at 0.3 m/s, from (3, 4) on, in MRCLAM's format."""
    lines = ["# Time [s]  x [m]  y [m]  orientation [rad]"]
    for n in range(600):
        turn = 0.05 * n * 0.02
        lines.append(
            f"{1248272272.8 + 0.02 * n:.3f} {3.0 + 6.0 * sin(turn):.4f} {4.0 + 6.0 * (1 - cos(turn)):.4f} {turn:.3f}"
        )
    path.write_text("\n".join(lines) + "\n")
    return path


def test_the_leader_drives_the_recorded_way_from_its_own_start_at_the_recorded_times(tmp_path: Path) -> None:
    scenario = with_leader(load("straight"), str(mrclam(tmp_path / "Robot1_Groundtruth.dat")))
    leading = check_mission(scenario.mission).leading
    assert leading.motion == "trajectory"
    assert leading.route_m[0] == pytest.approx((0.0, 0.0))
    assert leading.times_s[0] == 0.0
    assert leading.times_s[-1] == pytest.approx(12.0, abs=1.5)
    assert hypot(*leading.route_m[-1]) == pytest.approx(hypot(6.0 * sin(0.6), 6.0 * (1 - cos(0.6))), abs=STEP_M + 0.1)
    assert min(b - a for a, b in zip(leading.times_s, leading.times_s[1:], strict=False)) >= STEP_S - 1e-6


def test_a_recorded_run_leads_followers_again(tmp_path: Path) -> None:
    scenario = load("straight")
    leading = msgspec.structs.replace(scenario.mission.leading, route_m=((2.0, 0.0),))
    mission = msgspec.structs.replace(scenario.mission, robots=(1, 2), leading=leading)
    scenario = draw(msgspec.structs.replace(scenario, mission=mission), 1)
    run = simulate.run(scenario, 1, tmp_path / "run").folder
    bag.write(run, run / bag.FOLDER)
    again = with_leader(scenario, f"{run / bag.FOLDER}:/robot1/pose")
    assert again.mission.leading.route_m[-1] == pytest.approx((2.0, 0.0), abs=STEP_M + 0.1)
    assert check_mission(again.mission).leading.motion == "trajectory"
    with pytest.raises(Refused, match=r"topics with poses: .*/robot1/odom"):
        with_leader(scenario, f"{run / bag.FOLDER}:/robot9/odom")


@pytest.mark.parametrize(
    ("text", "said"),
    [("1 2 3 4\n2 x 3 4\n", "line 2: must be"), ("", "moves less"), ("1 nan 2 0\n2 3 inf 0\n", "moves less"),
     ("1 0 0 0\n9 0.1 0 0\n", "moves less")],
)  # fmt: skip
def test_a_file_that_is_no_recording_of_a_moving_robot_is_one_line(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.dat"
    path.write_text(text)
    with pytest.raises(Refused, match=said):
        with_leader(load("straight"), str(path))


@pytest.mark.parametrize("name", ["no.dat", "no_folder"])
def test_what_is_not_there_is_one_line(name: str, tmp_path: Path) -> None:
    with pytest.raises(Refused, match="--leader-from"):
        with_leader(load("straight"), str(tmp_path / name))
