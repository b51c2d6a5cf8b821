"""Campaigns: shares and orders change no byte of the merged results, and nothing that is done is done again or lost."""

from __future__ import annotations

import os
import signal
from functools import partial
from itertools import chain
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import pytest

from lfa.deploy.campaign.combine import combine
from lfa.deploy.campaign.commands.campaign import command
from lfa.deploy.campaign.commands.merge import merge
from lfa.deploy.campaign.folder import DESCRIPTION, Campaign, CampaignFolder, open_folder
from lfa.deploy.campaign.items import Item, ItemResult, name_of
from lfa.deploy.campaign.shard import Shard, parse_shard
from lfa.deploy.campaign.sweep import plan as plans
from lfa.deploy.campaign.sweep.runs import describe, done, items_of
from lfa.deploy.campaign.work import campaign_of, do_share
from lfa.protocol.errors import Refused
from tests.test_imports import ROOT

PLAN = """\
scenario = "circle"
title = "small"
seeds = "1..2"
robots = 2
repetitions = 2
faults = [[], ["kill leader at 1 s"]]
[set]
time_limit_s = 2
[assert]
goal_reached = false
left_behind_max = 0
"""


@pytest.fixture(scope="module")
def plan_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plan") / "plan.toml"
    path.write_text(PLAN)
    return path


@pytest.fixture(scope="module")
def whole(plan_path: Path) -> Path:
    """Folder of the campaign of `PLAN`, done in this process."""
    plan = plans.read_plan(plan_path)
    items = items_of(plan)
    kept = open_folder(plan_path.parent / "whole", describe(plan, items))
    for item in items:
        kept.store(item.name, item.measure())
    return kept.path


def _merged(folders: list[Path], out: Path) -> dict[str, bytes]:
    merge(folders, out, as_json=True)
    return {path.name: path.read_bytes() for path in sorted(out.iterdir()) if path.is_file()}


def test_merged_results_are_byte_equal_for_any_number_of_shares_in_any_order(whole: Path, tmp_path: Path) -> None:
    campaign = combine([whole]).campaign
    reference = _merged([whole], tmp_path / "all")
    assert set(reference) == {"index.html", "results.csv", "results.parquet"}
    for of in (2, 5):
        folders = []
        for number in range(1, of + 1):
            part = open_folder(tmp_path / f"{number}-{of}", campaign)
            for result in CampaignFolder(whole, campaign).results():
                if result.name in Shard(number, of).share(campaign.names):
                    part.store(result.name, ItemResult(result.data, result.complaint))
            folders.append(part.path)
        Random(of).shuffle(folders)
        assert _merged(folders, tmp_path / f"of-{of}") == reference


def test_a_page_shows_intervals_differences_and_the_worst_runs_in_folders_of_their_own(
    whole: Path, tmp_path: Path
) -> None:
    merge([whole], tmp_path / "merged", as_json=True)
    page = (tmp_path / "merged" / "index.html").read_text()
    for heading in ("Groups", "Paired differences", "Distributions", "Worst runs"):
        assert f">{heading}</h2>" in page
    assert "100.0 % [" in page, "a share of good runs has its Wilson interval"
    links = [part.partition('"')[0] for part in page.split('href="worst/')[1:]]
    assert links
    assert all((tmp_path / "merged" / "worst" / link / "summary.json").is_file() for link in links)


def test_a_repetition_that_differs_is_counted(whole: Path, tmp_path: Path) -> None:
    campaign = combine([whole]).campaign
    part = open_folder(tmp_path / "part", campaign)
    for n, result in enumerate(CampaignFolder(whole, campaign).results()):
        data = {**result.data, "metrics": {**result.data["metrics"], "duration_s": 9.0 if n == 1 else 2.0}}
        part.store(result.name, ItemResult(data, result.complaint))
    merge([part.path], tmp_path / "merged", as_json=True)
    assert "<b>1</b>repetitions that differ" in (tmp_path / "merged" / "index.html").read_text()


def test_the_tables_name_every_run_with_its_values(whole: Path, tmp_path: Path) -> None:
    from pyarrow import parquet

    merge([whole], tmp_path / "merged", as_json=True)
    table = parquet.read_table(tmp_path / "merged" / "results.parquet").to_pydict()
    assert table["run"] == list(combine([whole]).campaign.names)
    assert table["seed"] == [1, 1, 2, 2] * 2
    assert table["faults"] == ["none"] * 4 + ["kill leader at 1 s"] * 4
    assert (tmp_path / "merged" / "results.csv").read_text().splitlines()[0] == ",".join(table)


def test_a_run_of_a_campaign_has_the_summary_of_lfa_sim(tmp_path: Path) -> None:
    from lfa.deploy.faults.script import parse_all
    from lfa.deploy.run import simulate
    from lfa.deploy.scenario_loading import load_scenario

    scenario = load_scenario("circle", ["time_limit_s=3", "assert.goal_reached=false"], 3)
    faults = parse_all(scenario.mission, (), ["kill leader at 1.5 s"])
    recorded = simulate.run(scenario, 3, tmp_path / "run", faults).summary
    recorded.duration_s, recorded.real_time_factor, recorded.recording = 0.0, 0.0, None
    recorded.provenance = None
    assert simulate.measure(scenario, 3, faults).summary == recorded


def test_a_failed_run_says_why(plan_path: Path) -> None:
    group = plans.read_plan(plan_path).groups[0]
    late = msgspec.structs.replace(group.scenario, faults=("kill leader at 99 s",))
    assert done(late, 1, ()).complaint == "all_faults_done (kill leader at 99 s)"


# --- execution ------------------------------------------------------------------------------------------------------


def _noted(folder: Path, number: int, deadly: int) -> ItemResult:
    """Leave a mark for each call; the first call of the item `deadly` kills its worker."""
    mark = folder / f"{number}-{os.getpid()}"
    mark.touch()
    if number == deadly and len(list(folder.glob(f"{number}-*"))) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return ItemResult(number, "is three" if number == 3 else "")


def _items(folder: Path, count: int, deadly: int = -1) -> list[Item]:
    folder.mkdir(exist_ok=True)
    return [Item(name_of(n), f"item {n}", partial(_noted, folder, n, deadly)) for n in range(count)]


def test_a_worker_that_is_killed_loses_only_its_item_and_a_second_start_does_only_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(ROOT)  # a worker finds this module there
    items = _items(tmp_path / "marks", 6, deadly=1)
    campaign = campaign_of("test", "six", items)
    kept, failed = do_share(tmp_path / "out", campaign, items, jobs=2)
    tried = [len(list((tmp_path / "marks").glob(f"{n}-*"))) for n in range(6)]
    assert tried == [1, 2, 1, 1, 1, 1], "the item whose worker died is done again, and no other"
    assert (failed, len(kept.done())) == (1, 6)
    assert "failed: item 3: is three" in capsys.readouterr().err
    (tmp_path / "out" / "results" / f"{items[4].name}.json").unlink()
    do_share(tmp_path / "out", campaign, items)
    again = [len(list((tmp_path / "marks").glob(f"{n}-*"))) for n in range(6)]
    assert again == [1, 2, 1, 1, 2, 1]
    assert "5 of 6 runs are there already" in capsys.readouterr().err


def _interrupt() -> ItemResult:
    raise KeyboardInterrupt


def test_after_ctrl_c_what_was_done_is_told_and_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(ROOT)  # a worker finds this module there
    items = [*_items(tmp_path / "marks", 2), Item("last", "the last one", _interrupt)]
    campaign = campaign_of("test", "a test", items)
    with pytest.raises(KeyboardInterrupt):
        do_share(tmp_path / "out", campaign, items)
    assert f"interrupted: 2 of 3 runs are done, 0 failed; they are in {tmp_path / 'out'}" in capsys.readouterr().err
    assert len(open_folder(tmp_path / "out", campaign).results()) == 2


def test_shares_are_disjoint_and_together_the_whole() -> None:
    work_items = list(range(37))
    shares = [Shard(n, 5).share(work_items) for n in range(1, 6)]
    assert sorted(chain(*shares)) == work_items
    assert max(map(len, shares)) - min(map(len, shares)) <= 1


# --- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["5/4", "0/4", "1", "1/", "/4", "a/b", "1/0", "-1/4", "1/4/2"])
def test_a_share_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(Refused, match="must be like 3/16"):
        parse_shard(text)


def _other(campaign: Campaign, what: str) -> Campaign:
    return msgspec.structs.replace(campaign, **{what: "another"})


@pytest.mark.parametrize(("what", "says"), [("lfa", "of another, and this is"), ("plan", "of another plan")])
def test_a_folder_of_another_plan_or_version_is_refused_and_left_as_it_is(tmp_path: Path, what: str, says: str) -> None:
    items = _items(tmp_path / "marks", 2)
    campaign = campaign_of("test", "two", items)
    open_folder(tmp_path / "out", _other(campaign, what))
    before = {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()}
    with pytest.raises(Refused, match=says):
        do_share(tmp_path / "out", campaign, items)
    assert {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()} == before


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(Refused, match="not empty and no campaign"):
        open_folder(tmp_path, campaign_of("test", "two", _items(tmp_path / "marks", 2)))


@pytest.mark.parametrize("damage", [b"", b'{"name":', b"[]"])
def test_a_half_written_result_is_named_and_not_overwritten(tmp_path: Path, damage: bytes) -> None:
    items = _items(tmp_path / "marks", 2)
    campaign = campaign_of("test", "two", items)
    path = open_folder(tmp_path / "out", campaign).path / "results" / f"{items[0].name}.json"
    path.write_bytes(damage)
    with pytest.raises(Refused, match=r"half-written or damaged .*: remove it, and it is done again"):
        do_share(tmp_path / "out", campaign, items)
    assert path.read_bytes() == damage


def test_results_of_two_campaigns_are_not_merged(whole: Path, tmp_path: Path) -> None:
    open_folder(tmp_path / "other", _other(combine([whole]).campaign, "plan"))
    with pytest.raises(Refused, match="another campaign"):
        merge([whole, tmp_path / "other"], None, as_json=False)


def test_two_different_results_of_one_run_are_not_merged(whole: Path, tmp_path: Path) -> None:
    campaign = combine([whole]).campaign
    open_folder(tmp_path / "other", campaign).store(campaign.names[0], ItemResult({"outcome": "failed"}))
    with pytest.raises(Refused, match="differs from that in"):
        merge([whole, tmp_path / "other"], None, as_json=False)


def test_results_of_another_version_are_not_merged(whole: Path, tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    text = (whole / DESCRIPTION).read_text().replace("(code ", "(code x")
    (tmp_path / DESCRIPTION).write_text(text)
    with pytest.raises(Refused, match="merge with the version that did it"):
        merge([tmp_path], None, as_json=False)


def test_missing_runs_are_counted_and_make_the_exit_code_1(whole: Path, tmp_path: Path) -> None:
    part = open_folder(tmp_path / "part", combine([whole]).campaign)
    assert merge([part.path], None, as_json=True) == 1
    assert "8 of 8 items are missing" in (part.path / "merged" / "index.html").read_text()


@pytest.mark.parametrize("words", [["merge"], ["a.toml", "b.toml"], ["merge", "nowhere"], ["nowhere.toml"]])
def test_words_that_name_no_plan_and_no_folder_are_refused(words: list[str]) -> None:
    with pytest.raises(Refused):
        command(words)


def test_more_runs_than_max_runs_are_refused_before_one_is_done(plan_path: Path, tmp_path: Path) -> None:
    with pytest.raises(Refused, match=r"are 8 runs: must be at most 7 \(--max-runs\)"):
        command([str(plan_path)], max_runs=7, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_share_runs_from_the_command_line_and_says_how_far_it_is(
    plan_path: Path, whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command([str(plan_path)], shard="2/4", out=tmp_path / "out") == 0
    assert "2 of 2 runs" in capsys.readouterr().err
    assert {one.name for one in (tmp_path / "out" / "results").iterdir()} == {
        f"{name}.json" for name in combine([whole]).campaign.names[1::4]
    }


@pytest.mark.parametrize(
    "data", [None, [1], {}, {"outcome": "ended", "ok": 3, "metrics": {}}, {"outcome": "", "ok": True, "metrics": None}]
)
def test_a_result_of_another_shape_is_named_and_nothing_is_merged(whole: Path, tmp_path: Path, data: object) -> None:
    campaign = combine([whole]).campaign
    part = open_folder(tmp_path / "part", campaign)
    part.store(campaign.names[0], ItemResult(data))
    with pytest.raises(Refused, match=rf"results/{campaign.names[0]}\.json: damaged .*: remove it"):
        merge([part.path], None, as_json=False)
    assert not (part.path / "merged").exists()


@pytest.mark.parametrize("about", [None, {}, {"scenario": 3}])
def test_a_description_without_its_facts_is_refused(whole: Path, tmp_path: Path, about: object) -> None:
    broken = msgspec.structs.replace(combine([whole]).campaign, about=about)
    with pytest.raises(Refused, match=r"campaign\.json or a result is damaged .*: must be those of a sweep"):
        merge([open_folder(tmp_path / "part", broken).path], None, as_json=False)


def test_a_folder_in_the_place_of_a_result_is_named(whole: Path, tmp_path: Path) -> None:
    campaign = combine([whole]).campaign
    part = open_folder(tmp_path / "part", campaign)
    (part.path / "results" / f"{campaign.names[0]}.json").mkdir()
    with pytest.raises(Refused, match="removed, it is done again"):
        merge([part.path], None, as_json=False)


@pytest.mark.parametrize("options", [{"max_runs": 0}, {"on": "grid"}, {"on": "slurmm"}, {"shards": 0}, {"jobs": 0}])
def test_an_option_that_is_none_is_refused_before_a_folder_is_made(
    plan_path: Path, tmp_path: Path, options: dict[str, Any]
) -> None:
    with pytest.raises(Refused, match="must be"):
        command([str(plan_path)], out=tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()
