"""A recording, as the `mcap` library reads it, against the journals of the same run."""

from __future__ import annotations

from pathlib import Path

from lfa.deploy.faults.script import parse_all
from lfa.deploy.run.simulate import run
from lfa.world.description.load import load
from tests.rigs.recording_agreement import differing, recorded_ends

FAULTS = ("kill leader at 2 s", "restart 1 at 2.5 s")


def test_first_and_last_message_of_every_topic_are_those_of_the_journals(tmp_path: Path) -> None:
    scenario = load("paper_path1", ["time_limit_s=4.0"])
    folder = run(scenario, 3, tmp_path / "run", parse_all(scenario.mission, (), FAULTS)).folder
    ends = recorded_ends(folder)
    wanted = {f"/robot{n}/{topic}" for n in (1, 2, 3, 4) for topic in ("pose", "cmd_vel", "scan", "sensors")}
    assert wanted <= {channel for channel, *_ in ends}
    assert differing(folder) == [], "lfa sim paper_path1 --seed 3 --set time_limit_s=4.0"
    beams = [beam for (channel, *_), (_, scan) in ends.items() if "/scan" in channel for beam in scan["ranges_m"]]
    assert "inf" in beams
    assert any(isinstance(beam, float) for beam in beams)
