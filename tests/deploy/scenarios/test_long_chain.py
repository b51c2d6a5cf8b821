"""Many robots behind a slow leader in an empty world: their slots do not swing, and nobody is stuck."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from lfa.deploy.bench.harness.team import endless
from lfa.deploy.recording import event_log
from lfa.deploy.recording.run_folder import toml
from lfa.deploy.run.simulate import measure
from lfa.deploy.simulate import run
from lfa.world.description.scenario import Assert

LOST = (1, 5, 9)
"""The robots of one machine of four, the leader among them."""
SETTLED_S = 30.0


def test_e22_nobody_is_left_out_when_the_chain_closes_over_the_robots_of_a_lost_machine(tmp_path: Path) -> None:
    course = tmp_path / "endless.toml"
    course.write_text(toml(endless(12)))
    faults = [f"kill robot{robot} at 9 s" for robot in LOST]
    run(str(course), seed=1, set=["time_limit_s=16"], faults=faults, out=tmp_path / "run")
    said = event_log.of_kind(event_log.lines(tmp_path / "run"), "stuck")
    options = " ".join(f"--fault '{fault}'" for fault in faults)
    found = [(line["robot"], line["reason"]) for line in said]
    assert found == [], f"reproduce: lfa sim {course} --seed 1 --set time_limit_s=16 {options}"


def test_no_robot_of_a_long_chain_swings_round_its_slot_behind_a_slow_leader() -> None:
    """With rigid slots the third one drives at full speed, to and fro, and turns at its limit."""
    scenario = replace(endless(6), time_limit_s=40.0, asserted=Assert(goal_reached=False))
    truth = measure(scenario, 1).seen.truth
    late = {robot: rows[rows[:, 0] > SETTLED_S] for robot, rows in truth.items()}
    slowest, fastest = ({robot: round(float(end(rows[:, 4])), 3) for robot, rows in late.items()} for end in (min, max))
    assert min(slowest.values()) > 0.0 and max(fastest.values()) < 0.3, (slowest, fastest)
