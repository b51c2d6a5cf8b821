"""`make bench-table`: rows of benches become the table of the performance page."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfa.deploy.bench.agents import teams
from lfa.deploy.bench.lockstep import measure as lockstep
from lfa.deploy.bench.router import measure as router
from lfa.deploy.bench.sim.speed import CASES_FULL, GROWTH
from tests import bench_table

GOOD = {"name": "open/rays", "value": 7.25e6, "unit": "1/s", "bar": 5e6, "ratio": 1.45, "ok": True}
SHORT = {"name": "chain of 4/pose to accepted command, p50", "value": 0.7, "unit": "ms", "bar": 0.2, "ratio": 3.5}
SHORT["ok"] = False
FREE = {"name": "soak/faults", "value": 12.0, "unit": "times", "bar": None, "ratio": None, "ok": True}

BENCHES = bench_table.ROOT / "deploy" / "bench"


def test_a_row_has_value_bar_and_ratio_and_what_falls_short_its_bottleneck() -> None:
    table = bench_table.text({"lidar": [GOOD], "latency": [SHORT], "soak": [FREE]})
    assert "| lidar | open/rays | 7.25e+06 1/s | 5e+06 | 1.45 | ok |" in table
    assert "| latency | chain of 4/pose to accepted command, p50 | 0.7 ms | 0.2 | 3.5 | short |" in table
    assert "| soak | soak/faults | 12 times |  |  |  |" in table
    assert "- `latency` chain of 4/pose to accepted command, p50: next bottleneck: two hops through the router" in table


def test_without_a_row_below_its_bar_the_table_says_so() -> None:
    assert bench_table.text({"lidar": [GOOD]}).endswith("Nothing falls short.\n")


def test_new_rows_take_the_place_of_old_ones_of_the_same_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_table, "KEPT", tmp_path)
    bench_table.keep("lidar", [GOOD, FREE])
    bench_table.keep("lidar", [GOOD | {"value": 1.0}])
    assert [row["value"] for row in bench_table.kept({})["lidar"]] == [1.0, 12.0]


def test_rows_of_the_page_stay_where_their_bench_was_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_table, "KEPT", tmp_path)
    page = bench_table.PAGE.read_text()
    before = bench_table.on_page(page)
    assert {"lidar", "sim", "agent"} <= before.keys()
    assert bench_table.with_table(page, bench_table.text(bench_table.kept(before))) == page
    bench_table.keep("lidar", [before["lidar"][0] | {"value": 7.0}])
    after = bench_table.kept(before)
    assert [row["value"] for row in after["lidar"]] == [7.0, *(row["value"] for row in before["lidar"][1:])]
    assert after["sim"] == before["sim"]


def quantity_of(row: str) -> str:
    """Return the quantity of a row `CASE/QUANTITY`, or `WHAT/CASE/QUANTITY` by `operate` and of a federation, up to its
    first comma; of `growth/of QUANTITY` what grows.
    """
    parts = 2 if row.startswith(("stop/", "go/", "federation/")) else 1
    return row.removeprefix("growth/of ").split("/", parts)[-1].partition(",")[0]


def test_the_page_has_no_row_of_a_quantity_that_its_bench_prints_no_more() -> None:
    for bench, rows in bench_table.on_page(bench_table.PAGE.read_text()).items():
        files = [file for file in BENCHES.rglob("*.py") if bench in (file.stem, file.parent.name)]
        source = "".join(file.read_text() for file in files)
        for quantity in {quantity_of(row["name"]) for row in rows if "/" in row["name"]}:
            folder = quantity.removeprefix("share of ")
            assert quantity in source or (bench_table.ROOT / folder).is_dir(), f"{bench}: {quantity}"


def test_the_page_has_no_row_of_a_team_that_its_bench_measures_no_more() -> None:
    page = bench_table.on_page(bench_table.PAGE.read_text())
    cases = {
        "sim": {*(case.name for case in CASES_FULL), GROWTH},
        "agents": {case.name for case in teams.cases(teams.SIZES_FULL)},
        "lockstep": {case.name for case in lockstep.cases(1)},
        "router": {case.name for case in router.cases(full=True)},
    }
    for bench, known in cases.items():
        for row in page.get(bench, ()):
            assert any(row["name"].startswith(f"{case}/") for case in known), row["name"]


def test_the_page_has_marks_for_the_table() -> None:
    page = bench_table.PAGE.read_text()
    assert bench_table.with_table(page, "here\n").count("here\n") == 1
