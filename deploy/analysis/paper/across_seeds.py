"""Properties of control.md 7.1 that compare runs: path 1 with path 2, iteration 2 with 1, spikes of many seeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from msgspec import Struct

from lfa.deploy.analysis import episodes
from lfa.deploy.analysis.paper.checks import PATHS
from lfa.deploy.analysis.paper.criteria import Bar, Finding, Measured
from lfa.deploy.analysis.paper.experiment import Subject, duration_s, on_course
from lfa.deploy.analysis.run_data import Run

SPIKES_MIN = 20
"""Minimum number of pooled spikes for a meaningful rank correlation."""
CORRELATION_MIN = 0.8


class Kept(Struct, frozen=True):
    """Data of one run for comparisons; small, so that a bench can hold many."""

    scenario: str
    seed: int
    iteration: int
    """Iteration of the experiment: 2 when the obstacles of an earlier run are known, else 1."""
    duration_s: float
    way_m: float
    """Path length [m], summed over all robots."""
    requests: int
    """Number of orientation requests by leaders."""
    switches: int
    """Number of role switches from one leading robot to another."""
    spikes: tuple[tuple[float, float, float], ...]
    """Width [s], peak [m] and duration [s] of the causing avoidances, for each spike that an avoidance caused."""


def keep(run: Run) -> Kept:
    name, s = run.summary.scenario, Subject(run)
    pooled = [(spike, duration_s(s, spike)) for spike in on_course(s)] if name in PATHS else []
    return Kept(
        scenario=name,
        seed=run.summary.seed,
        iteration=2 if run.scenario.mission.leading.known_m else 1,
        duration_s=run.summary.sim_duration_s,
        way_m=sum(float(np.hypot(*np.diff(rows[:, 1:3], axis=0).T).sum()) for rows in run.truth.values()),
        requests=len(episodes.requests(run)),
        switches=sum(a.robot_id != b.robot_id for a, b in pairwise(run.leader_terms)),
        spikes=tuple((spike.width_s, spike.peak, lasted_s) for spike, lasted_s in pooled if lasted_s > 0.0),
    )


def across(runs: Sequence[Kept]) -> list[Finding]:
    """Return the finding of each comparison; with too few runs of the paper's paths `needs more runs`, no failure."""
    firsts = [run for run in runs if run.iteration == 1]
    again = [bar.judged(_largest_share(runs, of)) for bar, of in ITERATIONS]
    return [bar.judged(measure(firsts)) for bar, measure in COMPARISONS] + again


def _correlation(runs: Sequence[Kept]) -> Measured | None:
    return _ranked(runs, 2)


def _height(runs: Sequence[Kept]) -> Measured | None:
    return _ranked(runs, 1)


def _ranked(runs: Sequence[Kept], other: int) -> Measured | None:
    """Return the rank correlation of width and column `other` over pooled spikes; None with too few runs or spikes."""
    pooled = [spike for run in runs for spike in run.spikes]
    if len(runs) < 2 or len(pooled) < SPIKES_MIN:
        return None
    value = episodes.rank_correlation([spike[0] for spike in pooled], [spike[other] for spike in pooled])
    return Measured(value, f"{len(pooled)} spikes")


def _longer(runs: Sequence[Kept]) -> Measured | None:
    return _least_more(runs, lambda run: run.duration_s)


def _more_requests(runs: Sequence[Kept]) -> Measured | None:
    return _least_more(runs, lambda run: run.requests)


def _more_switches(runs: Sequence[Kept]) -> Measured | None:
    return _least_more(runs, lambda run: run.switches)


def _least_more(runs: Sequence[Kept], of: Callable[[Kept], float]) -> Measured | None:
    """Return the minimum excess of path 1 over path 2: over pairs of equal seed, else over all pairs."""
    ones, twos = ([run for run in runs if run.scenario == path] for path in PATHS)
    pairs = [(a, b) for a in ones for b in twos]
    pairs = [(a, b) for a, b in pairs if a.seed == b.seed] or pairs
    if not pairs:
        return None
    least, seed = min((of(a) - of(b), a.seed) for a, b in pairs)
    return Measured(least, f"seed {seed}, of {len(pairs)} pairs")


def _largest_share(runs: Sequence[Kept], of: Callable[[Kept], float]) -> Measured | None:
    """Return the maximum ratio of iteration 2 to iteration 1, over pairs of runs in the same world."""
    firsts = {(run.scenario, run.seed): run for run in runs if run.iteration == 1}
    pairs = [(first, run) for run in runs if run.iteration == 2 and (first := firsts.get((run.scenario, run.seed)))]
    if not pairs:
        return None
    largest, seed = max((of(second) / of(first), second.seed) for first, second in pairs)
    return Measured(largest, f"seed {seed}, of {len(pairs)} pairs")


COMPARISONS: tuple[tuple[Bar, Callable[[Sequence[Kept]], Measured | None]], ...] = (
    (Bar("7", "spikes' width by avoidance, rank correlation", ">=", CORRELATION_MIN), _correlation),
    (Bar("7", "spikes' height by width, rank correlation", ">", 0.0), _height),
    (Bar("8", "time of path 1 beyond path 2", ">", 0.0, "s"), _longer),
    (Bar("8", "orientation requests of path 1 beyond path 2", ">", 0.0), _more_requests),
    (Bar("8", "role switches of path 1 beyond path 2", ">", 0.0), _more_switches),
)

ITERATIONS: tuple[tuple[Bar, Callable[[Kept], float]], ...] = (
    (Bar("9", "way of iteration 2 in that of iteration 1", "<=", 1.0), lambda run: run.way_m),
    (Bar("9", "time of iteration 2 in that of iteration 1", "<=", 1.0), lambda run: run.duration_s),
)
