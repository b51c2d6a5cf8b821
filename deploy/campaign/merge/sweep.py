"""Merged sweep: a row for each run, a line for each group, and its worst runs, recorded whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from lfa.deploy.campaign.combine import Combined
from lfa.deploy.campaign.merge import sweep_page
from lfa.deploy.campaign.merge.files import ResultTable, Value
from lfa.deploy.campaign.merge.merged_runs import MergedSweep, interval, read, values_of, worst_runs
from lfa.deploy.campaign.merge.report import MergeReport
from lfa.deploy.campaign.sweep.metrics import METRICS, Metric
from lfa.deploy.campaign.sweep.runs import facts_of
from lfa.deploy.faults.script import parse_all
from lfa.deploy.own_code import load_files
from lfa.deploy.run import simulate
from lfa.deploy.scenario_loading import load_scenario

SHOWN = ("duration_s", "distance_error_rms_m", "bearing_error_rms_rad", "hop_l2", "failover_ms", "contacts")
"""Quantities of the terminal's table."""


def report(combined: Combined) -> MergeReport:
    """Return the merged sweep."""
    merged = read(combined)
    used = [metric for metric in METRICS if any(metric.name in run.result.metrics for run in merged.runs)]
    worst = worst_runs(merged)
    failed = sum(not run.result.ok for run in merged.runs)
    linked = tuple(run.name for run in worst[: sweep_page.LINKED])
    sections = sweep_page.sections(merged, used, worst)
    return MergeReport(tuple(_lines(merged, used)), _table(merged, used), sections, failed, linked)


def record(combined: Combined, name: str, folder: Path) -> None:
    """Do the run `name` once more and record it whole in the new folder `folder`."""
    facts = facts_of(combined.campaign)
    group, rest = divmod(combined.campaign.names.index(name), len(facts.seeds) * facts.repetitions)
    seed = facts.seeds[rest // facts.repetitions]
    load_files(facts.groups[group].own_code)
    with TemporaryDirectory(prefix="lfa-worst-") as place:
        path = Path(place) / f"{facts.scenario}.toml"
        path.write_text(facts.groups[group].scenario, encoding="utf-8")
        scenario = load_scenario(str(path))
    simulate.run(scenario, seed, folder, parse_all(scenario.mission, scenario.faults, facts.groups[group].faults))


def _lines(merged: MergedSweep, used: Sequence[Metric]) -> Iterator[str]:
    shown = [metric for metric in used if metric.name in SHOWN]
    width = max(map(len, (*merged.labels, "group")))
    yield f"{'group':<{width}}  runs   good  " + "  ".join(f"{metric.name:>22}" for metric in shown)
    for n, label in enumerate(merged.labels):
        runs = merged.of_group(n)
        good = sum(run.result.ok for run in runs)
        cells = (interval(values_of(runs, metric), f"{label} {metric.name}") for metric in shown)
        yield f"{label:<{width}}  {len(runs):>4}  {good:>5}  " + "  ".join(f"{cell:>22}" for cell in cells)


def _table(merged: MergedSweep, used: Sequence[Metric]) -> ResultTable:
    columns: dict[str, list[Value]] = {"run": [run.name for run in merged.runs]}
    for place, axis in enumerate(merged.facts.axes):
        columns[axis] = [merged.facts.groups[run.group].values[place] for run in merged.runs]
    columns |= {
        "seed": [run.seed for run in merged.runs],
        "repetition": [run.repetition for run in merged.runs],
        "outcome": [run.result.outcome for run in merged.runs],
        "ok": [run.result.ok for run in merged.runs],
        "complaint": [run.complaint for run in merged.runs],
    }
    columns |= {metric.name: [run.result.metrics.get(metric.name) for run in merged.runs] for metric in used}
    return ResultTable(columns)
