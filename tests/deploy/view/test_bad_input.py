"""Views of what is no run of this version, or without what they need: one line that says what would be right."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import termios
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.writer import Writer

from lfa.deploy.analysis import summary
from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.verification import playback
from lfa.deploy.client.session import FleetAddress, listen
from lfa.deploy.recording import mcap_reader
from lfa.deploy.run.simulate import run
from lfa.deploy.view.report import command as report
from lfa.deploy.view.report import page
from lfa.deploy.view.rerun import command as view
from lfa.protocol.errors import Refused
from lfa.world.description.load import load

LFA = "from lfa.deploy.cli import main; main()"
WITHOUT = "import sys; sys.modules[{0!r}] = None; sys.argv = ['lfa', *sys.argv[1:]]; "


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run(load("straight", ["time_limit_s=1.0"], 2), 1, tmp_path_factory.mktemp("runs") / "run").folder


@pytest.fixture
def copied(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "copied"))


def test_a_foreign_recording_is_refused_by_every_view(copied: Path) -> None:
    (copied / "recording.mcap").write_bytes(b"RIFF, and much more of another kind")
    for look in (view.converted, mcap_reader.read, lambda where: report.html([where])):
        with pytest.raises(Refused, match="no recording: must be an MCAP file that lfa wrote"):
            look(copied)
    with pytest.raises(Refused, match="no recording"):
        playback.play(copied, 1.0, "replay", None)


def test_a_recording_of_another_program_is_refused(copied: Path) -> None:
    with (copied / "recording.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/robot1/pose", "cdr", 0)
        writer.add_message(channel, 1, b"\x00\x01binary", 1, 1)
        writer.finish()
    with pytest.raises(Refused, match="recorded by another program, /robot1/pose"):
        view.converted(copied)


def test_a_recording_that_was_cut_off_is_shown_as_far_as_it_goes_and_says_so(
    copied: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = copied / "recording.mcap"
    recording.write_bytes(recording.read_bytes()[:-2000])
    assert report.html([copied]).startswith("<!")
    said = capsys.readouterr().err
    assert said.startswith(f"{recording}: cut off")
    assert said.count("\n") == 1


def test_a_refused_recording_leaves_nothing_half_converted(copied: Path) -> None:
    before = sorted(copied.iterdir())
    (copied / "recording.mcap").write_bytes(b"RIFF, and much more of another kind")
    with pytest.raises(Refused):
        view.converted(copied)
    assert sorted(copied.iterdir()) == before


@pytest.mark.parametrize("name", ["*", "a/b", ""])
def test_nothing_is_said_to_more_than_one_fleet(name: str, copied: Path) -> None:
    with pytest.raises(Refused, match="--fleet"):
        playback.play(copied, 1.0, name, None)
    with (
        pytest.raises(Refused, match="--fleet"),
        listen(FleetAddress(name, "tcp/127.0.0.1:1", ()), frozenset({"*/pose"})),
    ):
        pass


def test_a_summary_of_another_version_is_refused(copied: Path) -> None:
    (copied / "summary.json").write_text('{"scenario": "straight", "robots": 3}')
    for look in (summary.read, lambda where: page.of([Run(where)])):
        with pytest.raises(Refused, match="of another version"):
            look(copied)


@pytest.mark.parametrize(
    ("module", "arguments", "extra"),
    [("rerun", ("view", "RUN"), "view"), ("matplotlib", ("plot", "RUN"), "view"), ("numpy", ("report", "RUN"), "world"),
     ("mcap", ("report", "RUN"), "view")],
)  # fmt: skip
def test_a_missing_extra_is_named_with_the_command_that_installs_it(
    module: str, arguments: tuple[str, ...], extra: str, folder: Path
) -> None:
    words = [str(folder) if word == "RUN" else word for word in arguments]
    code = WITHOUT.format(module) + LFA
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert f"install with: pip install 'lfa[{extra}]'" in done.stderr


@pytest.fixture
def terminal() -> Iterator[int]:
    """A terminal of 40 x 10 characters."""
    ours, theirs = os.openpty()
    termios.tcsetwinsize(theirs, (10, 40))
    yield theirs
    os.close(ours)
    os.close(theirs)


def test_a_terminal_that_is_too_small_is_told_its_size(terminal: int) -> None:
    told = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
    words = [sys.executable, "-c", LFA, "watch"]
    done = subprocess.run(words, stdin=terminal, stdout=terminal, stderr=subprocess.PIPE, text=True, env=told)
    assert done.returncode == 2
    assert done.stderr == "lfa: terminal of 40 x 10 characters: must be at least 60 x 12, or use --once\n"


def test_without_a_display_a_picture_is_made_beside_the_recording(
    copied: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(shutil, "which", lambda _name: None)  # no Xvfb either: drawn without the viewer
    assert view.command(copied) == 0
    said = capsys.readouterr()
    assert str(copied / "view.png") in said.out
    assert "\nno display here" in said.err
    assert (copied / "view.png").read_bytes().startswith(b"\x89PNG")


def test_a_report_that_the_disk_takes_in_part_leaves_no_half_page(copied: Path, tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    words = ["report", str(copied), "--out", str(out)]
    small = f"import resource, sys; sys.argv = ['lfa', *{words!r}]; from lfa.deploy.view.report import page; "
    limit = "resource.setrlimit(resource.RLIMIT_FSIZE, (16384, 16384)); "
    done = subprocess.run([sys.executable, "-c", small + limit + LFA], capture_output=True, text=True, check=False)
    assert (done.returncode, out.exists()) == (2, False), done.stderr
    assert done.stderr.splitlines()[-1] == f"lfa: --out {out}: cannot be written (File too large)"
