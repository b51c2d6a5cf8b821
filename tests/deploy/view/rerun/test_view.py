"""`lfa view RUN`: everything that was recorded of poses, scans and slots is in the `.rrd`, and it becomes a picture."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
from collections import Counter
from pathlib import Path

import pytest

from lfa.deploy.faults.script import parse_all
from lfa.deploy.recording.mcap_reader import messages
from lfa.deploy.run.simulate import run
from lfa.deploy.view.rerun import command
from lfa.deploy.view.rerun.screenshot import take
from lfa.deploy.view.rerun.viewer import viewer_path
from lfa.protocol.errors import Refused
from lfa.world.description.load import load

RRD_BYTES_A_SECOND_MAX = 250_000  # 30 MB for two minutes
PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scenario = load("paper_path1", ["time_limit_s=6.0"])
    made = tmp_path_factory.mktemp("runs") / "run"
    return run(scenario, 2, made, parse_all(scenario.mission, (), ["kill leader at 3 s"])).folder


def _rows(rrd: Path) -> Counter[str]:
    """Rows of each entity that change with time, as rerun itself counts them."""
    told = subprocess.run([viewer_path(), "rrd", "print", str(rrd)], capture_output=True, text=True, check=True)
    found: Counter[str] = Counter()
    for line in told.stdout.splitlines():
        chunk = re.search(r"with (\d+) rows .* - /(world/\S+) - data columns: \[(.*)\]", line)
        if chunk is not None and re.search("positions|translation", chunk[3]):
            found[chunk[2]] += int(chunk[1])
    return found


def test_each_robot_has_as_many_poses_scans_and_slots_as_were_recorded(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "SHOW_EVERY_S", 0.0)
    rrd = command.converted(folder)
    assert "s of the run converted" in capsys.readouterr().err
    topics = frozenset({"pose", "scan", "tracking"})
    rows, said = _rows(rrd), Counter((owner, topic) for owner, topic, *_ in messages(folder, topics))
    for robot in ("robot1", "robot2", "robot3", "robot4"):
        assert rows[f"world/{robot}"] == said[robot, "pose"] > 0
        assert rows[f"world/{robot}/scan"] == said[robot, "scan"] > 0
        assert rows[f"world/slots/{robot}"] == said[robot, "tracking"]
    assert rrd.stat().st_size < 6.0 * RRD_BYTES_A_SECOND_MAX


def test_what_another_version_converted_is_converted_anew_and_removed(folder: Path, tmp_path: Path) -> None:
    copied = shutil.copytree(folder, tmp_path / "copied", ignore=shutil.ignore_patterns("*.rrd", "*.rbl"))
    stale = [copied / name for name in ("recording.rrd", "recording.rbl", "recording.0123456789ab.rrd")]
    for path in stale:
        path.write_bytes(b"of another version")
    rrd = command.converted(copied)
    assert rrd.read_bytes().startswith(b"RRF")
    assert [path for path in stale if path.exists()] == []
    assert command.converted(copied) == rrd
    assert sorted(path.suffix for path in copied.glob("recording.*")) == [".mcap", ".rbl", ".rrd"]


def test_without_a_screen_the_picture_is_drawn_and_says_so(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    picture = tmp_path / "run.png"
    said = take(command.converted(folder), picture, folder)
    assert "drawn without the viewer: no display, and no Xvfb" in said
    assert picture.read_bytes().startswith(PNG)


@pytest.mark.skipif(not (os.environ.get("DISPLAY") or shutil.which("Xvfb")), reason="neither display nor Xvfb here")
def test_with_a_virtual_screen_the_picture_is_the_viewers_or_says_why_not(folder: Path, tmp_path: Path) -> None:
    picture = tmp_path / "run.png"
    said = take(command.converted(folder), picture, folder)
    assert "(rerun's viewer)" in said or "the viewer" in said
    assert picture.read_bytes().startswith(PNG)


def test_bad_input_is_refused_in_one_line(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(Refused, match=r"no run folder, it has no recording\.mcap"):
        command.converted(tmp_path)
    with pytest.raises(Refused, match=r"must be a \.png in a folder that exists"):
        take(folder / "recording.rrd", tmp_path / "none" / "a.png", folder)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        with pytest.raises(Refused, match="taken"):
            command.command(folder, serve_web=True, port=taken.getsockname()[1])


def test_a_recording_that_was_cut_off_is_shown_as_far_as_it_goes(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text((folder / "scenario.toml").read_text())
    recorded = (folder / "recording.mcap").read_bytes()
    (tmp_path / "recording.mcap").write_bytes(recorded[: len(recorded) // 2])
    assert command.converted(tmp_path).is_file(), "a recording cut off is read up to its last whole chunk"


def test_map_and_route_of_who_explores_are_in_the_view(tmp_path: Path) -> None:
    scenario = load("explore", ["time_limit_s=4.0"], 2)
    folder = run(scenario, 1, tmp_path / "run").folder
    told = subprocess.run(
        [viewer_path(), "rrd", "print", str(command.converted(folder))],
        capture_output=True,
        text=True,
        check=True,
    )
    assert " - /world/planned - " in told.stdout
    assert len(set(re.findall(r"/world/map/tiles/robot1/\S+", told.stdout))) > 1


def test_terrain_and_the_share_of_lost_rows_are_in_the_view(tmp_path: Path) -> None:
    scenario = load("terrain", ["time_limit_s=4.0", "radio.loss=0.3"], 2)
    folder = run(scenario, 1, tmp_path / "run").folder
    told = subprocess.run(
        [viewer_path(), "rrd", "print", str(command.converted(folder))],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "/world/terrain/0" in told.stdout
    assert "/radio/robot2" in told.stdout
    lost = [float(s.counters["rows_lost"]) for *_, s in messages(folder, frozenset({"status"})) if s.counters]
    assert max(lost) > 0.0
