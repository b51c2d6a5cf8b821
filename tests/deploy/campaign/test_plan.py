"""A plan is read strictly: every mistake has its line, and what it means is the same list of runs everywhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfa.deploy.campaign.sweep.plan import parse_seeds, read_plan
from lfa.deploy.campaign.sweep.runs import items_of
from lfa.deploy.campaign.sweep.short_form import plan_file, split
from lfa.protocol.errors import Refused

GOOD = """\
scenario = "circle"
seeds = "1..3"
controllers = ["law", "kanayama"]
faults = [[], ["kill leader at 5 s"]]
[set]
time_limit_s = 10
[assert]
goal_reached = false
[grid]
mission.formation.separation_m = [0.8, 1.0]
[[list]]
radio.loss = [0.0, 0.2]
radio.delay_s = [0.01, 0.02]
"""


def lines_of(tmp_path: Path, text: str) -> list[str]:
    path = tmp_path / "plan.toml"
    path.write_text(text)
    with pytest.raises(Refused) as refused:
        read_plan(path)
    return [line.removeprefix(f"{path}") for line in refused.value.lines]


def test_grids_multiply_and_the_keys_of_a_list_change_together(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(GOOD)
    plan = read_plan(tmp_path / "plan.toml")
    assert plan.axes == ("controller", "faults", "mission.formation.separation_m", "radio.loss, radio.delay_s")
    assert (len(plan.groups), plan.runs) == (16, 48)
    last = plan.groups[-1].scenario
    assert (last.mission.following.controller, last.radio.loss, last.radio.delay_s) == ("kanayama", 0.2, 0.02)
    assert plan.groups[-1].faults == ("kill leader at 5 s",)


def test_a_run_is_named_by_all_that_its_result_depends_on(tmp_path: Path) -> None:
    path = tmp_path / "plan.toml"
    path.write_text(GOOD)
    names = [item.name for item in items_of(read_plan(path))]
    assert len(set(names)) == len(names)
    assert names == [item.name for item in items_of(read_plan(path))]
    path.write_text(GOOD.replace("time_limit_s = 10", "time_limit_s = 11"))
    assert not set(names) & {item.name for item in items_of(read_plan(path))}
    path.write_text("title = 'another'\n" + GOOD.replace("1..3", "2..4"))
    moved = {item.name for item in items_of(read_plan(path))}
    assert len(moved & set(names)) == 32, "seeds 2 and 3 are the same runs"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("seeds =", "sedes =", ":2: sedes = 1..3: no such key: did you mean 'seeds'?"),
        ('"1..3"', '"3..1"', ":2: seeds = 3..1: must be a text such as"),
        ('"1..3"', "[1, 1]", ":2: seeds = [1, 1]: must be a text such as"),
        ('"1..3"', "[]", ":2: seeds = []: must be a text such as"),
        ('["law", "kanayama"]', "[]", ":3: controllers = []: must be at least one entry"),
        ("kanayama", "kanayma", ":3: mission.following.controller = kanayma: must be one of"),
        ("kill leader", "kil leader", ":4: faults[1]: --fault 'kil leader at 5 s': must be like"),
        ("kill leader", "kill router", ":4: faults[1]: fault 'kill router at 5 s': only in lfa run"),
        ("[0.8, 1.0]", "[]", ":10: grid.mission.formation.separation_m = []: must be a list of at least one value"),
        ("[0.8, 1.0]", "1.0", ":10: grid.mission.formation.separation_m = 1.0: must be a list of at least one value"),
        ("[0.8, 1.0]", "[0.8, 0.8]", ":10: grid.mission.formation.separation_m: 0.8 stands there twice"),
        ("[0.8, 1.0]", "[0.8, -1.0]", ":10: mission.formation.separation_m = -1.0: must be a number from 0.4"),
        ("[0.8, 1.0]", "[nan, 1.0]", ":10: mission.formation.separation_m = nan: must be a finite number"),
        ("time_limit_s = 10", "time_limit_s = inf", ":6: time_limit_s = inf: must be"),
        ("separation_m = [0.8", "seperation_m = [0.8", ":10: mission.formation.seperation_m = 0.8: no such key"),
        ("mission.formation.separation_m = [0.8, 1.0]\n", "", ":9: grid = {}: must be a table with at least one key"),
        ("[0.01, 0.02]", "[0.01]", ":11: list[0]: lists of [1, 2] values: must be equally long"),
        ("mission.formation.separation_m", "time_limit_s", ":10: grid.time_limit_s: time_limit_s is set by set."),
        ("mission.formation.separation_m = [0.8, 1.0]", 'mission.following.controller = ["law"]',
         ":10: grid.mission.following.controller: mission.following.controller is set by controllers too"),
        ("mission.formation.separation_m = [0.8, 1.0]", "radio.loss = [0.1, 0.3]",
         ":12: list[0].radio.loss: radio.loss is set by grid.radio.loss too"),
        ("goal_reached", "goal_reachd", ":8: assert.goal_reachd = False: no such key"),
        ('seeds = "1..3"', 'seeds = "1..3"\nrepetitions = 0', ":3: repetitions = 0: must be a number from 1 to 100"),
        ('"1..3"', '"1..99999"', ":2: seeds: 16 groups, 99999 seeds and 1 repetitions are 1599984 runs: must be at m"),
        ('"circle"', '"circel"', ":1: scenario: no scenario 'circel': did you mean 'circle'?"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_plan_is_one_line_with_its_place(tmp_path: Path, old: str, new: str, says: str) -> None:
    lines = lines_of(tmp_path, GOOD.replace(old, new))
    assert lines[0].startswith(says)
    assert len(lines) == 1


def test_several_mistakes_are_told_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("seeds", "sedes").replace("[0.8, 1.0]", "[]").replace("[0.01, 0.02]", "[0.01]")
    assert len(lines_of(tmp_path, text)) == 3


@pytest.mark.parametrize("text", ["", "x", "3..1", "1..", "..3", "1,,2", "1,1", "-1..3", "1..99999999"])
def test_seeds_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(Refused, match="seed"):
        parse_seeds(text)


def test_the_short_form_means_the_same_runs_as_the_plan(tmp_path: Path) -> None:
    from lfa.deploy.campaign.sweep.plan import plan_of

    (tmp_path / "plan.toml").write_text('scenario = "circle"\nseeds = "1..3"\n[grid]\nradio.loss = [0.0, 0.2]\n')
    plan = read_plan(tmp_path / "plan.toml")
    short = plan_of(plan_file("circle", "1..3", ["radio.loss=0.0,0.2"], None, ()))
    assert [item.name for item in items_of(short)] == [item.name for item in items_of(plan)]


def test_commas_in_brackets_and_quotes_part_no_values() -> None:
    assert split("[1, 2], 'a,b',3") == ["[1, 2]", "'a,b'", "3"]


def test_a_goal_is_one_point_and_no_axis() -> None:
    file = plan_file("explore", "1..2", ["goal=3.0,4.0"], None, ())
    assert file.document["set"] == {"goal": [3.0, 4.0]}
    assert "grid" not in file.document
