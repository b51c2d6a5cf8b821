"""What Ctrl-C ends says what was found so far, and exits as every command that a signal ends."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from lfa.deploy.analysis.verification import command as verification
from lfa.deploy.bench import controllers
from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.campaign import work
from lfa.deploy.campaign.execute import Finished
from lfa.deploy.campaign.items import Item, ItemResult
from lfa.deploy.fuzz.fault_injector import Played
from lfa.deploy.fuzz.search import command as fuzz
from lfa.deploy.fuzz.search.searches import Search

QUANTITY = Quantity("way", "m", 2.0)


def _rows() -> Iterator[list[BenchRow]]:
    yield [row("case", QUANTITY, 1.0)]
    raise KeyboardInterrupt


@pytest.mark.parametrize("as_json", [False, True])
def test_a_bench_prints_the_rows_that_are_complete(capsys: pytest.CaptureFixture[str], as_json: bool) -> None:
    with pytest.raises(KeyboardInterrupt):
        show(_rows(), as_json)
    said = capsys.readouterr()
    assert said.err == "interrupted: 1 rows are complete\n"
    if as_json:
        assert json.loads(said.out)["interrupted"]
        assert len(json.loads(said.out)["rows"]) == 1
    else:
        assert said.out.startswith("case/way")


def test_a_search_counts_every_schedule_that_was_played(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def played(search: Search, seeds: range) -> Iterator[tuple[int, Played]]:
        for seed in seeds[:3]:
            yield seed, search.player(search.schedule(seed), None)
        raise KeyboardInterrupt

    monkeypatch.setattr(Search, "played", played)
    assert fuzz.command(seeds="1000") == 130
    assert capsys.readouterr().out.startswith("interrupted: 3 of 1000 schedules")


def test_a_check_of_runs_says_how_many_are_checked(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def interrupted(_folder: Path) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(verification, "check", interrupted)
    with pytest.raises(KeyboardInterrupt):
        verification.command([tmp_path, tmp_path])
    assert capsys.readouterr().err == "interrupted: 0 of 2 runs are checked\n"


def test_results_in_a_folder_that_goes_are_not_said_to_be_kept(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def first(items: Sequence[Item], _jobs: int) -> Iterator[Finished]:
        yield Finished(items[0], ItemResult({}, ""))
        raise KeyboardInterrupt

    monkeypatch.setattr(work, "execute", first)
    with pytest.raises(KeyboardInterrupt):
        controllers.run(as_json=False, seeds=1)
    assert "runs are done, 0 failed; nothing is kept: with --out DIR" in capsys.readouterr().err
