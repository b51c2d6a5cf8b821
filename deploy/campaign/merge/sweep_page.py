"""Page of a merged sweep: groups with intervals, paired differences, distributions, and the worst runs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from lfa.deploy.campaign.merge.boxes import box_plot
from lfa.deploy.campaign.merge.merged_runs import NONE, MergedRun, MergedSweep, array_of, interval, values_of
from lfa.deploy.campaign.merge.page import Linked, Section, rows, tiles
from lfa.deploy.campaign.sweep import statistics
from lfa.deploy.campaign.sweep.metrics import Metric
from lfa.deploy.campaign.sweep.statistics import Interval

PAIRS_MAX = 200
"""Number of pairs of groups whose differences stand on the page."""
GROUPS_MAX = 200
"""Number of groups whose distributions are drawn, and whose pairs are compared."""
FAILURES_MAX = 200
WORST_OF_GROUP = 3
LINKED = 3
"""Number of the worst runs of all that are recorded whole when they are merged, into `worst/<name>`."""


def sections(merged: MergedSweep, used: Sequence[Metric], worst: Sequence[MergedRun]) -> tuple[Section, ...]:
    """Return the parts of the page. `worst` are all runs, the worst first."""
    return (
        Section("Summary", _head(merged)),
        Section("Groups", _groups(merged, used)),
        Section("Paired differences", _differences(merged, used)),
        Section("Distributions", _distributions(merged, used)),
        Section("Worst runs", _worst(merged, worst)),
        Section("Failures", _failures(merged)),
    )


def _head(merged: MergedSweep) -> str:
    good = sum(run.result.ok for run in merged.runs)
    facts = (
        ("runs", len(merged.runs)),
        ("groups", len(merged.labels)),
        ("seeds", len(merged.facts.seeds)),
        ("good", good),
        ("failed", len(merged.runs) - good),
        ("repetitions that differ", _differing(merged) if merged.facts.repetitions > 1 else NONE),
    )
    axes = ", ".join(merged.facts.axes) or "none"
    return f"{tiles(facts)}<p class='soft'>Scenario {merged.facts.scenario}. Varied: {axes}.</p>"


def _differing(merged: MergedSweep) -> int:
    """Return the number of repeated runs whose result is not that of the first."""
    first = {(run.group, run.seed): run.result for run in merged.runs if run.repetition == 1}
    return sum(first.get((run.group, run.seed), run.result) != run.result for run in merged.runs)


def _groups(merged: MergedSweep, used: Sequence[Metric]) -> str:
    body = []
    for n, label in enumerate(merged.labels):
        runs = merged.of_group(n)
        share = statistics.wilson(sum(run.result.ok for run in runs), len(runs)) if runs else None
        cells = [_estimate(values_of(runs, metric), f"{label} {metric.name}", len(runs)) for metric in used]
        body.append((label, len(runs), NONE if share is None else _percent(share), *cells))
    heads = ("group", "runs", "good", *(metric.name for metric in used))
    return (
        rows(heads, body, text=(0,))
        + (
            "<p class='soft'>Good: share of runs whose exit code is 0, with its 95 % Wilson interval. Quantities: "
            f"median over the seeds, with its 95 % interval from {statistics.RESAMPLES} bootstrap resamples; with the "
            "number of runs that have a value where some have none.</p>"
        )
        + rows(("quantity", "meaning", "worse"), [(m.name, m.text, m.worse) for m in used], text=(0, 1, 2))
    )


def _percent(share: Interval) -> str:
    return f"{100 * share.value:.1f} % [{100 * share.low:.1f}, {100 * share.high:.1f}]"


def _estimate(values: dict[int, float], name: str, runs: int) -> str:
    text = interval(values, name)
    return text if len(values) in (0, runs) else f"{text} ({len(values)} of {runs})"


def _differences(merged: MergedSweep, used: Sequence[Metric]) -> str:
    pairs = _comparable(merged)
    body = []
    for a, b in pairs[:PAIRS_MAX]:
        first, second = merged.of_group(a), merged.of_group(b)
        for metric in used:
            body += _difference(merged, a, b, metric, values_of(first, metric), values_of(second, metric))
    rest = f"<p class='soft'>{len(pairs) - PAIRS_MAX} further pairs of groups.</p>" if len(pairs) > PAIRS_MAX else ""
    heads = ("first", "second", "quantity", "seeds", "median of second − first", "effect d_z", "less", "more")
    return (
        "<p class='soft'>Pairs of groups that differ in one axis, on the seeds that both have a value for. d_z is the "
        "mean difference over the standard deviation of the differences; less and more count the seeds.</p>"
        + rows(heads, body, text=(0, 1, 2))
        + rest
    )


def _comparable(merged: MergedSweep) -> list[tuple[int, int]]:
    """Return the pairs of groups that differ in one axis."""
    values = [group.values for group in merged.facts.groups]
    if len(values) > GROUPS_MAX:
        return []
    return [
        (a, b)
        for a, b in combinations(range(len(values)), 2)
        if sum(x != y for x, y in zip(values[a], values[b], strict=True)) == 1
    ]


def _difference(
    merged: MergedSweep, a: int, b: int, metric: Metric, first: dict[int, float], second: dict[int, float]
) -> list[tuple[object, ...]]:
    seeds = [seed for seed in first if seed in second]
    if not seeds:
        return []
    one, other = (np.array([values[seed] for seed in seeds]) for values in (first, second))
    found = statistics.paired(one, other, f"{merged.labels[a]} {merged.labels[b]} {metric.name}")
    if found.less == found.more == 0:
        return []
    d = found.difference
    effect = NONE if found.effect is None else f"{found.effect:+.2f}"
    text = f"{d.value:+.4g} [{d.low:+.3g}, {d.high:+.3g}]"
    return [(merged.labels[a], merged.labels[b], metric.name, found.pairs, text, effect, found.less, found.more)]


def _distributions(merged: MergedSweep, used: Sequence[Metric]) -> str:
    shown = range(min(len(merged.labels), GROUPS_MAX))
    runs = [merged.of_group(n) for n in shown]
    parts = []
    for metric in used:
        groups = [(merged.labels[n], array_of(values_of(runs[n], metric))) for n in shown]
        parts.append(f"<h3>{metric.name}: {metric.text}</h3>{box_plot(groups, metric.name)}")
    return "".join(parts) + "<p class='soft'>Box: quartiles and median; line: least to largest value.</p>"


def _worst(merged: MergedSweep, worst: Sequence[MergedRun]) -> str:
    body, of_group = [], dict[int, int]()
    for run in worst:
        of_group[run.group] = of_group.get(run.group, 0) + 1
        if of_group[run.group] <= WORST_OF_GROUP:
            error = run.result.metrics.get("distance_error_rms_m")
            shown = NONE if error is None else f"{error:.4g}"
            command = f"{merged.facts.groups[run.group].command} --seed {run.seed}"
            folder = Linked(run.name, f"worst/{run.name}/") if run in worst[:LINKED] else run.name
            body.append((merged.labels[run.group], run.seed, folder, run.result.outcome, shown, command))
    heads = ("group", "seed", "run", "outcome", "distance_error_rms_m", "again")
    return rows(heads, body[:FAILURES_MAX], text=(0, 2, 3), long=5)


def _failures(merged: MergedSweep) -> str:
    failed = [run for run in merged.runs if not run.result.ok and run.repetition == 1]
    body = [(merged.labels[run.group], run.seed, run.name, run.complaint) for run in failed[:FAILURES_MAX]]
    rest = f"<p class='soft'>{len(failed) - FAILURES_MAX} more.</p>" if len(failed) > FAILURES_MAX else ""
    return rows(("group", "seed", "run", "why"), body, text=(0, 2), long=3) + rest
