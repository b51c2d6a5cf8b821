"""Recordings as clips: on the page, in one HTML file, as a film."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.bench.harness.browser import Browser, chromium
from lfa.deploy.view.figures.style import look
from lfa.deploy.view.picture.clip import clip_of
from lfa.deploy.view.picture.film import GIF_FRAMES_MAX, robot_colours
from tests.rigs.lfa_runs import lfa
from tests.rigs.web_page import served

HTML_BYTES_A_S = 5_000_000 / 120.0
"""Largest size of the HTML file a second of four robots: 5 MB for two minutes."""
MARKUP = "</script><img src=x onerror=window.hacked=1>"
pytestmark = pytest.mark.xdist_group("web")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording in which the leader is killed and an obstacle is set down."""
    folder = tmp_path_factory.mktemp("web") / "run"
    faults = ("--fault", "kill leader at 3 s", "--fault", "obstacle 4,2,0.3 at 2 s")
    setting = ("--set", f"title={MARKUP!r}", "--set", "faults=[]", "--set", "time_limit_s=7.0")
    lfa("sim", "leader_killed", *faults, *setting, "--out", str(folder))
    return folder


@pytest.fixture(scope="module")
def tab() -> Iterator[Browser]:
    if chromium() is None:
        pytest.skip("no Chromium")
    with Browser() as browser:
        yield browser


def check_played(tab: Browser) -> None:
    """The clip is at its start, can be sought and played, and shows what happened when."""
    tab.wait_for("lfa.models.length && lfa.models[0].robots.size === 4 && lfa.models[0].leader === null")
    assert tab.value("document.getElementById('title').textContent") == MARKUP
    tab.value("lfa.order({do: 'seek', value: 2.9})")
    tab.wait_for("lfa.models[0].leader === 1 && lfa.models[0].added.length === 1")
    tab.click("#play")
    tab.wait_for("lfa.models[0].leader === 2 && lfa.models[0].robots.get(1).role === 'gone'")
    assert tab.value("document.querySelectorAll('.marks .lead').length") == 2
    tab.value("lfa.order({do: 'seek', value: 1})")
    tab.wait_for("lfa.models[0].leader === 1 && lfa.models[0].added.length === 0 && lfa.models[0].leads.length === 1")
    assert tab.value("window.hacked === undefined && document.images.length === 0")
    assert tab.errors == []


@pytest.mark.processes
def test_the_page_plays_a_recording(run: Path, tab: Browser) -> None:
    with served(str(run)) as server:
        tab.errors.clear()
        tab.open(server.look)
        check_played(tab)
        tab.open("about:blank")


@pytest.mark.processes
def test_two_recordings_are_played_on_one_clock(run: Path, tab: Browser) -> None:
    with served(str(run), str(run)) as server:
        tab.errors.clear()
        tab.open(server.look)
        tab.wait_for("lfa.models.length === 2 && lfa.models[1].robots.size === 4")
        tab.value("lfa.order({do: 'seek', value: 5})")
        tab.wait_for("lfa.models.every((model) => model.leader === 2 && model.t > 4.8)")
        assert tab.errors == []
        tab.open("about:blank")


def test_one_html_file_plays_it_without_a_server(run: Path, tab: Browser, tmp_path: Path) -> None:
    path = tmp_path / "clip.html"
    done = lfa("view", str(run), "--html", str(path))
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{path}\n", "drawing the recording ...\n")
    assert path.stat().st_size < 7.0 * HTML_BYTES_A_S
    tab.errors.clear()
    tab.open(path.as_uri())
    check_played(tab)


def test_a_gif_shows_the_whole_run(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "clip.gif"
    assert lfa("view", str(run), "--gif", str(path)).returncode == 0
    with Image.open(path) as film:
        assert 50 < getattr(film, "n_frames", 0) <= GIF_FRAMES_MAX


def test_a_robot_has_the_colour_of_the_figures_in_a_film(run: Path) -> None:
    recorded = Run(run)
    frames = [{"robots": [(robot, 0.0, 0.0) for robot in (9, 3, 1, 2, 4)]}]
    colours = robot_colours({"robots": [1, 2, 3, 4]}, frames)
    of_figures = {robot: look(recorded, robot)["color"] for robot in (1, 2, 3, 4)}
    assert {robot: colours[robot] for robot in of_figures} == of_figures
    assert colours[9] not in of_figures.values(), "a spare has a colour of its own"


def test_an_mp4_without_ffmpeg_is_refused_in_one_line(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    done = lfa("view", str(run), "--mp4", str(tmp_path / "clip.mp4"))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "needs ffmpeg" in done.stderr


@pytest.mark.parametrize("arguments", [("view", "--html", "x.html"), ("view", ".", "--gif", "x.gif"), ("web", ".")])
def test_without_a_recording_it_is_told_in_one_line(arguments: tuple[str, ...], tmp_path: Path) -> None:
    done = lfa(*(str(tmp_path) if word == "." else word for word in arguments))
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


def test_the_news_of_a_clip_come_no_earlier_than_they_happened(run: Path) -> None:
    pane = clip_of([run])["panes"][0]
    assert all(item["at"] >= item.get("t", 0.0) - 0.2 for item in pane["news"])
    assert [frame["t"] for frame in pane["frames"]] == sorted(frame["t"] for frame in pane["frames"])
