"""What a run keeps of itself: all, its summary, or nothing; and what its summary says about its making."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from lfa.deploy.analysis import summary as summaries
from lfa.deploy.cli import build
from lfa.deploy.client.term_count import TermCount

SHORT = ("sim", "straight", "--robots", "2", "--set", "goal=[1.0, 0.0]")


def sim(*words: str) -> int:
    code = build(["sim"])([*SHORT, *words], standalone_mode=False, prog_name="lfa")
    assert isinstance(code, int)
    return code


def test_a_folder_with_a_space_is_printed_so_that_a_shell_finds_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "my run"
    assert sim("--out", str(folder)) == 0
    said = capsys.readouterr().out
    (line,) = [line for line in said.splitlines() if line.startswith("see it: ")]
    assert shlex.split(line)[-1] == str(folder)
    assert not (folder / "figures").exists(), "figures are drawn on demand"
    made = summaries.read(folder).provenance
    assert made is not None
    assert made.version
    assert made.host
    assert made.command


def test_record_summary_keeps_what_is_small(tmp_path: Path) -> None:
    assert sim("--record", "summary", "--out", str(tmp_path / "run")) == 0
    kept = {path.name for path in (tmp_path / "run").iterdir()}
    assert kept == {"summary.json", "events.jsonl", "scenario.toml"}


def test_record_none_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert sim("--record", "none") == 0
    assert "goal_reached" in (said := capsys.readouterr().out)
    assert "run folder" not in said
    assert list(tmp_path.iterdir()) == []


def test_terms_are_counted_from_the_first_of_the_run() -> None:
    assert [TermCount([1795960024479, 1795960024481]).number(n) for n in (1795960024479, 1795960024481)] == [1, 3]
    live = TermCount()
    assert [live.number(7), live.number(8), live.number(7)] == [1, 2, 1]
