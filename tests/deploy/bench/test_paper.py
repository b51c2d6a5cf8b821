"""`lfa bench paper` and `lfa bench world`: the worst of many runs, and rows that a script can read."""

from __future__ import annotations

import json

import msgspec
import pytest

from lfa.deploy.analysis.paper.criteria import Bar, Finding, Measured
from lfa.deploy.bench import paper, world

LESS = Bar("7", "distance error outside of events", "<", 0.02, "m")
MORE = Bar("7", "spikes with an event", ">=", 0.9)
NONE = Bar("7", "late spikes", "=", 0.0)


def findings(bar: Bar, *values: float) -> list[Finding]:
    return [bar.judged(Measured(value)) for value in values]


@pytest.mark.parametrize(
    ("bar", "values", "worst", "holds"),
    [
        (LESS, (0.01, 0.03, 0.015), 0.03, 2),
        (MORE, (1.0, 0.85, 0.95), 0.85, 2),
        (NONE, (0.0, 2.0, 0.0), 2.0, 2),
        (MORE, (1.0, float("nan")), 1.0, 1),
        (MORE, (float("nan"),), None, 0),
    ],
)
def test_a_row_has_the_worst_value_and_in_how_many_runs_it_holds(
    bar: Bar, values: tuple[float, ...], worst: float | None, holds: int
) -> None:
    row = paper._row("path", findings(bar, *values))
    assert (row.value, row.holds) == (worst, holds)
    assert row.ok == (row.holds == row.of)


@pytest.mark.parametrize(
    ("bar", "values", "ratio"),
    [(LESS, (0.01, 0.03), 1.5), (MORE, (1.0, 0.81), 0.9), (NONE, (2.0,), None), (MORE, (float("nan"),), None)],
)
def test_a_row_has_the_ratio_of_its_worst_value_to_the_bar(
    bar: Bar, values: tuple[float, ...], ratio: float | None
) -> None:
    assert paper._row("path", findings(bar, *values)).ratio == ratio


def test_the_cost_of_a_world_is_a_row_beside_its_bar(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(world, "SIMULATED_S", 0.2)
    world.run(as_json=True)
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["name"], row["bar"]) for row in rows] == [
        ("world/4 robots/in process", 15.0), ("world/20 robots/in process", 60.0)]  # fmt: skip
    assert all(row["value"] > 0.0 for row in rows)


def test_kept_runs_of_the_paper_make_the_rows_of_fresh_ones() -> None:
    bar = Bar("7", "distance error outside of events", "<", 0.02, "m")
    path = paper.PATHS[0]
    runs = [paper.PaperRun(path, seed, tuple(findings(bar, 0.01 * seed)), ()) for seed in (1, 2)]
    stored = [msgspec.convert(msgspec.json.decode(msgspec.json.encode(run)), paper.PaperRun) for run in runs]
    assert paper.rows_of(stored) == paper.rows_of(runs)
    assert paper.rows_of(runs)[0].holds == 1
