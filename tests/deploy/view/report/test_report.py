"""`lfa report`: one page with everything on it, that needs nothing else, in a real browser as well."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from base64 import b64decode
from pathlib import Path
from xml.etree import ElementTree

import pytest

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.faults.script import parse_all
from lfa.deploy.recording.event_log import FaultDone
from lfa.deploy.run.simulate import run
from lfa.deploy.view.figures.catalogue import FIGURES, drawn
from lfa.deploy.view.figures.style import label
from lfa.deploy.view.report import command, page
from lfa.deploy.view.report.html import NONE, in_mm
from lfa.protocol.errors import Refused
from lfa.world.description.load import load

BYTES_MAX = 3_000_000
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SECTIONS = [name for name, _ in page.SECTIONS]


def _ran(folder: Path, seed: int, robots: int = 4) -> Path:
    scenario = load("paper_path1" if robots == 4 else "straight", ["time_limit_s=6.0"], robots)
    return run(scenario, seed, folder, parse_all(scenario.mission, (), ["kill leader at 3 s"])).folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _ran(tmp_path_factory.mktemp("runs") / "one", 1)


def _images(html: str) -> list[str]:
    return [b64decode(data).decode() for data in re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', html)]


def test_every_section_and_figure_is_on_the_page(folder: Path) -> None:
    html = command.html([folder])
    assert [name for name in SECTIONS if f">{name}</h2>" not in html] == []
    images = _images(html)
    assert len(images) == len(FIGURES)
    assert all(ElementTree.fromstring(image).tag.endswith("svg") for image in images)
    assert len(html.encode()) < BYTES_MAX


def test_a_spare_is_drawn_as_the_last_robot(tmp_path: Path) -> None:
    scenario = load("straight", ["time_limit_s=2.0", "world.spares=[{id=7, start=[-3.0, -2.0, 0.0]}]"], 2)
    spared = Run(run(scenario, 1, tmp_path / "run", ()).folder)
    assert [label(spared, robot) for robot in spared.truth] == ["robot 1", "robot 2", "robot 7"]
    assert drawn("fig09_path_flow", spared).axes


@pytest.mark.parametrize("name", ["fig07_distance_error", "fig09_path_flow", "lease_timeline", "leader_timeline"])
def test_no_text_stands_on_a_line_without_a_ground_of_its_own(folder: Path, name: str) -> None:
    figure = drawn(name, Run(folder))
    texts = [text for axes in figure.axes for text in axes.texts]
    assert texts
    beside_bars = [text for text in texts if text.get_color() != "white"]
    assert [text.get_text() for text in beside_bars if not text.get_bbox_patch()] == []


def test_the_failover_and_the_fault_are_told(folder: Path) -> None:
    html = command.html([folder])
    assert "first command after" in html
    assert re.search(r"<td>3\.00 s</td><td class=\"text\">kill</td><td>1</td>", html)


def test_the_page_asks_for_nothing_from_elsewhere(folder: Path) -> None:
    html = command.html([folder])
    assert not re.search(r'(src|href)="(?!data:|#)', html)
    assert not re.search(r"<script[^>]*src", html)
    assert "url(" not in html
    assert "The MIT License" in (page.HERE / "uplot" / "LICENSE").read_text()


def test_tile_table_and_curve_say_the_same_of_an_error(folder: Path) -> None:
    html = command.html([folder])
    rms = {r.id: r.distance_error_rms_m for r in Run(folder).summary.robots if r.distance_error_rms_m is not None}
    assert rms, "nobody settled: the claim is about nothing"
    worst = max(rms, key=lambda robot: rms[robot])
    assert f"<b>{in_mm(rms[worst])}</b>rms distance error of robot {worst}" in html
    for robot, error_m in rms.items():
        assert f"<td>{in_mm(error_m)}</td>" in html
        assert f'"name":"robot {robot}, rms {in_mm(error_m)}"' in html


def test_a_curve_keeps_its_spikes_and_its_holes(folder: Path) -> None:
    run = Run(folder)
    (packed, *_) = re.findall(r'<script type="application/json">(.*?)</script>', command.html([folder]))
    for line, (robot, errors) in zip(json.loads(packed)["series"], run.errors.items(), strict=True):
        assert line["name"].startswith(f"robot {robot}")
        shown = [abs(y) for y in line["y"] if y is not None]
        assert max(shown) == pytest.approx(1000.0 * float(abs(errors.distance).max()), rel=1e-3)
        assert None in line["y"] or errors.t[0] < 0.05


def test_two_runs_stand_side_by_side_and_are_subtracted(folder: Path, tmp_path: Path) -> None:
    html = command.html([folder, _ran(tmp_path / "two", 2)])
    assert "second − first" in html
    assert len(_images(html)) == 2 * len(FIGURES)


def test_only_a_fault_with_a_victim_has_a_time_of_recovery(folder: Path) -> None:
    killed = Run(folder)
    victim = killed.summary.faults[0].target
    without, _ = page.recovery(killed, FaultDone(3.0, "kill", victim))
    assert without.endswith(" ms")
    for kind, target in (("cut", "1-2"), ("loss", "0.1"), ("loss", 1), ("heal", "")):
        assert page.recovery(killed, FaultDone(3.0, kind, target)) == (NONE, NONE)


def test_a_large_team_stays_small_on_the_page(tmp_path: Path) -> None:
    html = command.html([_ran(tmp_path / "many", 1, robots=20)])
    assert len(html.encode()) < BYTES_MAX
    run = Run(tmp_path / "many")
    assert sum(label(run, robot) is not None for robot in run.robots) <= 12


def test_what_is_no_finished_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Refused, match=r"no finished run, it has no summary\.json"):
        command.html([tmp_path])


def test_a_command_that_cannot_be_done_says_so_first(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(Refused, match=r"no finished run, it has no summary\.json"):
        command.command(folder, other=tmp_path)
    with pytest.raises(Refused, match="must be in a folder that exists"):
        command.command(folder, out=tmp_path / "none" / "a.html")
    assert capsys.readouterr().err == ""


@pytest.mark.skipif(BROWSER is None, reason="no Chromium here")
def test_a_browser_shows_it_without_a_complaint(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text(command.html([folder]), encoding="utf-8")
    assert BROWSER is not None
    quiet = (
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--enable-logging=stderr",
        f"--user-data-dir={tmp_path}/chrome",
    )
    shown = subprocess.run(
        [BROWSER, *quiet, "--dump-dom", path.as_uri()], capture_output=True, text=True, timeout=120, check=True
    )
    assert shown.stdout.count("<img") == len(FIGURES)
    assert shown.stdout.count("<table") >= 5
    assert shown.stdout.count('<div class="u-wrap"') == shown.stdout.count('class="chart"') == 5
    assert [line for line in shown.stderr.splitlines() if "CONSOLE" in line] == []
