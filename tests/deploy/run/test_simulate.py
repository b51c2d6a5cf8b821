"""`lfa sim`: the same seed gives the same bytes, another seed another run, and all of it is in the folder."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from lfa.deploy.analysis import tracking_errors
from lfa.deploy.analysis.summary import Summary, read
from lfa.deploy.faults.script import parse_all
from lfa.deploy.recording import mcap_reader
from lfa.deploy.recording.run_folder import make, scenario_of
from lfa.deploy.run.simulate import run
from lfa.protocol.errors import Refused
from lfa.protocol.runtime import journal
from lfa.world.description.load import draw, load

SHORT = ("mission.leading.route_m=[[2.0, 0.0]]",)


def _summary(folder: Path, name: str = "straight", *overrides: str, seed: int = 0, fault: str | None = None) -> Summary:
    scenario = load(name, [*SHORT, "faults=[]", *overrides])
    faults = parse_all(scenario.mission, (), [] if fault is None else [fault])
    return run(scenario, seed, folder, faults).summary


def _bytes(folder: Path, hash_seed: str) -> tuple[bytes, bytes]:
    """events.jsonl and recording.mcap of one run in a process with that hash seed."""
    code = (
        "import sys; from pathlib import Path; from lfa.deploy.run.simulate import run;"
        "from lfa.world.description.load import load;"
        f"run(load('leader_killed', {list(SHORT)!r}), 5, Path(sys.argv[1]))"
    )
    environment = os.environ | {"PYTHONHASHSEED": hash_seed}
    subprocess.run([sys.executable, "-c", code, str(folder)], env=environment, check=True, timeout=120)
    return (folder / "events.jsonl").read_bytes(), (folder / "recording.mcap").read_bytes()


def test_the_same_seed_gives_the_same_bytes_whatever_the_hash_seed(tmp_path: Path) -> None:
    first, second = (_bytes(tmp_path / seed, seed) for seed in ("0", "1"))
    assert first[0] == second[0], "events.jsonl differs: lfa sim leader_killed --seed 5, PYTHONHASHSEED=0 and 1"
    assert first[1] == second[1], "recording.mcap differs: lfa sim leader_killed --seed 5, PYTHONHASHSEED=0 and 1"


@pytest.mark.parametrize("out", [".", "..", "/", "n" * 300])
def test_a_place_where_no_folder_can_be_made_is_refused_by_its_name(
    out: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    (tmp_path / "here" / "something").touch()
    with pytest.raises(Refused, match=f"^--out {out}: "):
        make(Path(out), load("straight"))


def test_two_seeds_differ_where_there_is_noise(tmp_path: Path) -> None:
    one, two = (_summary(tmp_path / str(seed), "leader_killed", seed=seed) for seed in (1, 2))
    assert one.robots[1].distance_error_rms_m != two.robots[1].distance_error_rms_m
    assert one.robots[0].final_pose != two.robots[0].final_pose


def test_without_noise_followers_keep_a_tenth_of_a_millimetre_at_steady_speed(tmp_path: Path) -> None:
    summary = _summary(tmp_path / "run", "straight", "mission.leading.route_m=[[10.0, 0.0]]")
    assert summary.outcome == "goal_reached"
    seen = mcap_reader.read(tmp_path / "run")
    for robot in (2, 3, 4):
        followed = tracking_errors.of_follower(seen, robot)
        assert followed is not None
        steady = (followed.t > 10.0) & (followed.t < 18.0)
        assert np.sqrt(np.mean(followed.distance[steady] ** 2)) < 1e-4, f"robot {robot}: lfa sim straight"


def test_a_killed_leader_is_replaced_and_the_folder_tells_it(tmp_path: Path) -> None:
    summary = _summary(tmp_path / "run", fault="kill leader at 2 s")
    assert summary.outcome == "goal_reached"
    assert summary.violations == []
    assert [(f.victim, f.leader) for f in summary.failovers] == [(1, 2)]
    assert [robot.alive for robot in summary.robots] == [False, True, True, True]
    assert summary.exit_code == 0


@pytest.mark.parametrize("fault", ["stop 3 at 1 s for 0.5 s", "terminate 4 at 1 s"])
def test_a_fault_on_a_follower_ends_at_the_goal(tmp_path: Path, fault: str) -> None:
    summary = _summary(tmp_path / "run", fault=fault)
    assert summary.outcome == "goal_reached"
    assert summary.exit_code == 0


def test_a_fault_that_the_run_did_not_live_to_see_is_no_success(tmp_path: Path) -> None:
    summary = _summary(tmp_path / "run", fault="kill leader at 100 s")
    assert summary.outcome == "goal_reached"
    assert [a.name for a in summary.assertions if not a.ok] == ["all_faults_done"]
    assert summary.exit_code == 1


def test_the_scenario_in_the_folder_is_the_one_that_was_run(tmp_path: Path) -> None:
    _summary(tmp_path / "run", "paper_path1", "time_limit_s=2.0", seed=3)
    ran = scenario_of(tmp_path / "run")
    wanted = draw(load("paper_path1", [*SHORT, "faults=[]", "time_limit_s=2.0"]), 3)
    assert replace(ran, name="paper_path1") == wanted


@pytest.mark.parametrize(
    ("obstacle", "vary"),
    [
        ("center_m=[20,3], walk_m=2, speed_mps=0.3", "moving_phase=true"),
        ("center_m=[20,3], waypoints_m=[[20,9]], speed_mps=9.9", "moving_phase=true"),
        ("center_m=[20,3], velocity_mps=[0,9.9]", "moving_phase=true"),
        ("center_m=[20,3], velocity_mps=[0,0.001]", "moving_phase=true"),
        ("center_m=[-1,0], waypoints_m=[[5,0]], speed_mps=0.3", "moving_phase=true"),
        ("center_m=[39,0], waypoints_m=[[41,0]], speed_mps=0.3", "moving_phase=true"),
        ("center_m=[0.5,0], mass_kg=1", "starts_m=0.3"),
    ],
)
def test_what_a_seed_draws_in_bounds_is_read_again_from_the_folder(tmp_path: Path, obstacle: str, vary: str) -> None:
    scenario = load("straight", [f"world.obstacles=[{{{obstacle}, radius_m=0.3}}]", f"world.vary.{vary}"])
    for seed in range(20):
        drawn = draw(scenario, seed)
        assert replace(scenario_of(make(tmp_path / "run", drawn)), name="straight") == drawn, f"seed {seed}"
        (tmp_path / "run" / "scenario.toml").unlink()


def test_every_node_has_a_journal_and_every_robot_a_trace(tmp_path: Path) -> None:
    _summary(tmp_path / "run", "straight", "time_limit_s=2.0")
    names = {path.name: path for path in (tmp_path / "run" / "journal").iterdir()}
    assert set(names) == {f"{name}-1.bin" for name in ("world", "witness", "robot1", "robot2", "robot3", "robot4")}
    heading, entries = journal.read(names["robot2-1.bin"])
    assert heading.node == "robot2"
    assert sum(1 for _ in entries) > 100
    assert set(mcap_reader.read(tmp_path / "run").truth) == {1, 2, 3, 4}


def test_a_run_does_not_write_over_another(tmp_path: Path) -> None:
    _summary(tmp_path / "run", "straight", "time_limit_s=1.0")
    _summary(tmp_path / "run", "straight", "time_limit_s=1.0", seed=9)
    assert read(tmp_path / "run").seed == 0
    assert read(tmp_path / "run-2").seed == 9
