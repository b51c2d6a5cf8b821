"""`lfa bench learn`: what it measures here, and what it says where the other simulators are missing."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from lfa.deploy.bench.learn import measure
from lfa.protocol.errors import Refused


@pytest.fixture
def peers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(measure, "PEERS", tmp_path)
    return tmp_path


def test_without_the_other_simulators_the_own_steps_are_measured_and_a_line_names_what_is_missing(
    peers: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(measure, "steps_of_team", lambda: 7.0)
    assert measure.run(as_json=True) == 0
    said = capsys.readouterr()
    (only,) = json.loads(said.out)["rows"]
    assert (only["name"], only["value"], only["bar"], only["ok"]) == (
        "lfa/steps per second of processor time", 7.0, None, True,
    )  # fmt: skip
    assert said.err == "not measured: VMAS, navground: not installed here, make peers-learn does it\n"


def test_a_step_of_the_team_takes_processor_time() -> None:
    assert measure.steps_of_team(2) > 0.0


def test_rows_that_no_group_has_are_refused() -> None:
    with pytest.raises(Refused, match="--rows 'gazebo': no row has such a name; they begin with lfa, VMAS, navground"):
        measure.run(as_json=True, rows="gazebo")


def test_a_simulator_that_cannot_be_imported_is_refused_in_one_line(peers: Path) -> None:
    (peers / "bin").mkdir()
    (peers / "bin" / "python").symlink_to(sys.executable)
    with pytest.raises(Refused, match=r"^vmas_scene.py: ModuleNotFoundError: .*: make peers-learn must have installed"):
        measure.steps_of_peer("vmas_scene.py", 1)


def test_the_other_simulators_are_of_exact_versions() -> None:
    lines = (Path(__file__).parent / "learn_peers.txt").read_text().splitlines()
    assert all("==" in line for line in lines) and {line.partition("=")[0] for line in lines} >= {"vmas", "navground"}
