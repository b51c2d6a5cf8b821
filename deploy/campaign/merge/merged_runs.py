"""Runs of a merged sweep, by group and seed."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import numpy as np
from msgspec import Struct

from lfa.deploy.campaign.combine import Combined
from lfa.deploy.campaign.sweep import statistics
from lfa.deploy.campaign.sweep.metrics import Metric
from lfa.deploy.campaign.sweep.runs import SweepFacts, SweepResult, facts_of
from lfa.deploy.campaign.sweep.statistics import Values
from lfa.protocol.errors import Refused

NONE = "–"


class MergedRun(Struct, frozen=True):
    """One run of the merged table."""

    name: str
    group: int
    seed: int
    repetition: int
    result: SweepResult
    complaint: str


class MergedSweep(Struct, frozen=True):
    """Runs of a sweep by group, and what they are runs of."""

    facts: SweepFacts
    labels: tuple[str, ...]
    runs: tuple[MergedRun, ...]

    def of_group(self, group: int) -> list[MergedRun]:
        """Return the first repetition of each run of a group: a further one says nothing new."""
        return [run for run in self.runs if run.group == group and run.repetition == 1]


def read(combined: Combined) -> MergedSweep:
    """Return the runs of a combined campaign with their groups and seeds. Raises Refused for a damaged result."""
    facts = facts_of(combined.campaign)
    per_group = len(facts.seeds) * facts.repetitions
    runs = []
    for number, name in enumerate(combined.campaign.names):
        stored = combined.results.get(name)
        if stored is not None:
            group, rest = divmod(number, per_group)
            seed, repetition = divmod(rest, facts.repetitions)
            try:
                result = msgspec.convert(stored.data, SweepResult)
            except msgspec.ValidationError as error:
                raise Refused(f"results/{name}.json: damaged ({error}): remove it, and it is done again") from None
            runs.append(MergedRun(name, group, facts.seeds[seed], repetition + 1, result, stored.complaint))
    labels = tuple(", ".join(group.values) or facts.scenario for group in facts.groups)
    return MergedSweep(facts, labels, tuple(runs))


def worst_runs(merged: MergedSweep) -> list[MergedRun]:
    """Return the runs, the worst first: those that failed, then by the largest distance error of a follower."""
    first = [run for run in merged.runs if run.repetition == 1]
    return sorted(first, key=lambda run: (run.result.ok, -_badness(run), run.group, run.seed))


def values_of(runs: Sequence[MergedRun], metric: Metric) -> dict[int, float]:
    """Return the values of a quantity by seed, of the runs that have one."""
    return {run.seed: run.result.metrics[metric.name] for run in runs if metric.name in run.result.metrics}


def _badness(run: MergedRun) -> float:
    return run.result.metrics.get("distance_error_rms_m", 0.0)


def array_of(values: dict[int, float]) -> Values:
    """Return the values as an array, in the order of the seeds."""
    return np.array(list(values.values()), dtype=np.float64)


def interval(values: dict[int, float], name: str) -> str:
    """Return the median of the values with its interval as text; `name` seeds the resampling."""
    if not values:
        return NONE
    found = statistics.median(array_of(values), name)
    return f"{found.value:.4g} [{found.low:.3g}, {found.high:.3g}]"
