"""Searches and benches are campaigns: they shard, resume and merge as plans do."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from lfa.deploy.analysis.verification.command import command as verify
from lfa.deploy.bench import motion
from lfa.deploy.bench.harness.command import command as bench
from lfa.deploy.bench.harness.kept import Keep, measured_or_kept
from lfa.deploy.bench.harness.rows import CasePart, Quantity, many, measured
from lfa.deploy.campaign.commands.merge import merge
from lfa.deploy.campaign.folder import open_folder
from lfa.deploy.campaign.shard import Shard
from lfa.deploy.campaign.work import campaign_of
from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.schedules import draw
from lfa.deploy.fuzz.search import shares
from lfa.deploy.fuzz.search.command import command as fuzz
from lfa.deploy.fuzz.search.searches import Search
from lfa.protocol.errors import Refused
from tests.protocol.lease.planted import PLANTED
from tests.test_imports import ROOT

CSV = Path("merged") / "results.csv"


def test_shares_of_a_fuzz_search_play_every_seed_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Search, "chunk", 2)
    for number in (1, 2):
        assert fuzz(seeds="0..4", out=tmp_path / f"{number}", shard=f"{number}/2") == 0
    capsys.readouterr()
    assert merge([tmp_path / "1", tmp_path / "2"], None, as_json=False) == 0
    assert "5 schedules" in capsys.readouterr().out


def test_a_violation_is_shrunk_on_the_spot_and_stands_with_seed_and_schedule_on_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    planted = next(bug for bug in PLANTED if bug.what == "a restarted process votes at once")
    planted.plant(monkeypatch)
    seed = next(seed for seed in range(20) if play(draw(seed)).violations)
    item = shares._item(range(seed, seed + 1), Search())
    result = item.measure()
    (found,) = result.data["found"]
    assert found["again"] == f"lfa fuzz --seed {seed} -v"
    assert "robots, witness" in found["shrunk"]
    assert f"reproduce: lfa fuzz --seed {seed} -v" in result.complaint
    kept = open_folder(
        tmp_path, campaign_of(shares.KIND, "one", [item], shares.facts_of(range(seed, seed + 1), Search()))
    )
    kept.store(item.name, result)
    assert merge([tmp_path], None, as_json=False) == 1
    page = (tmp_path / "merged" / "index.html").read_text()
    assert f"Seed {seed}: {found['says'][:2]}" in page
    assert "robots, witness" in page
    assert found["says"] in (tmp_path / CSV).read_text()


def _values(number: int) -> list[float]:
    return [1.0, float(number)]


def test_a_bench_in_shares_has_the_rows_of_a_whole_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(ROOT)  # a worker finds this module there
    quantities = (Quantity("good", "runs", 3.0, "at least"), Quantity("score", "", over="mean"))
    cases = [many(f"case/{c}", quantities, [CasePart(n, partial(_values, n)) for n in (1, 2, 6)]) for c in "ab"]
    rows = list(measured(cases, 1))
    assert [row.value for row in rows[0]] == [3.0, 3.0]
    some = list(measured_or_kept("test", cases, 1, "*", Keep(tmp_path / "out", Shard(1, 2))))
    assert some == [], "a case is told when all of its parts are there"
    assert list(measured_or_kept("test", cases, 1, "*", Keep(tmp_path / "out", Shard(2, 2)))) == rows
    assert merge([tmp_path / "out"], None, as_json=False) == 0
    assert "case/a/good" in (tmp_path / "out" / CSV).read_text()


def test_each_seed_of_a_motion_bench_is_a_part_of_its_own(tmp_path: Path) -> None:
    case = next(case for case in motion.cases(3, tmp_path) if case.name == "scenario/straight")
    assert [part.facts for part in case.parts] == [1, 2, 3]


def test_runs_are_verified_in_shares(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from lfa.deploy.run.simulate import run
    from lfa.deploy.scenario_loading import load_scenario

    scenario = load_scenario("straight", ["time_limit_s=1", "assert.goal_reached=false"], 1)
    folders = [run(scenario, seed, tmp_path / f"run{seed}").folder for seed in (1, 2)]
    for shard in ("1/2", "2/2"):
        assert verify(folders, out=tmp_path / "out", shard=shard) == 0
    assert "straight, seed 2" in capsys.readouterr().out
    assert merge([tmp_path / "out"], None, as_json=False) == 0
    assert (tmp_path / "out" / CSV).read_text().splitlines()[1:] == ["straight,1,", "straight,2,"]


def test_a_share_without_a_folder_is_refused(tmp_path: Path) -> None:
    for call in (
        partial(fuzz, shard="1/2"),
        partial(bench, "motion", shard="1/2"),
        partial(verify, [tmp_path], shard="1/2"),
        partial(bench, "lidar", out=tmp_path / "out"),
    ):
        with pytest.raises(Refused, match=r"--out"):
            call()
