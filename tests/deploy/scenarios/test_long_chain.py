"""Twelve robots behind a slow leader in an empty world: their slots swing, and nobody is stuck."""

from __future__ import annotations

from pathlib import Path

from lfa.deploy.bench.harness.team import endless
from lfa.deploy.recording import event_log
from lfa.deploy.recording.run_folder import toml
from lfa.deploy.simulate import run

LOST = (1, 5, 9)
"""The robots of one machine of four, the leader among them."""


def test_e22_nobody_is_left_out_when_the_chain_closes_over_the_robots_of_a_lost_machine(tmp_path: Path) -> None:
    course = tmp_path / "endless.toml"
    course.write_text(toml(endless(12)))
    faults = [f"kill robot{robot} at 9 s" for robot in LOST]
    run(str(course), seed=1, set=["time_limit_s=16"], faults=faults, out=tmp_path / "run")
    said = event_log.of_kind(event_log.lines(tmp_path / "run"), "stuck")
    options = " ".join(f"--fault '{fault}'" for fault in faults)
    found = [(line["robot"], line["reason"]) for line in said]
    assert found == [], f"reproduce: lfa sim {course} --seed 1 --set time_limit_s=16 {options}"
