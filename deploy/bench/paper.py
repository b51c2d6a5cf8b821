"""`lfa bench paper`: worst values of the properties of the paper's figures (control.md 7.1), over seeds of both paths.

Every run is simulated in its own process. Properties that compare runs (path 1 with path 2, rank correlations over the
pooled avoidance episodes, iteration 2 with 1) are evaluated over all runs.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.analysis.paper import across_seeds
from lfa.deploy.analysis.paper.across_seeds import Kept
from lfa.deploy.analysis.paper.checks import PATHS
from lfa.deploy.analysis.paper.criteria import Finding
from lfa.deploy.bench.harness.kept import Keep
from lfa.deploy.campaign.items import Item, ItemResult, name_of
from lfa.deploy.campaign.work import campaign_of, do_share
from lfa.deploy.process.worker_pool import workers

KIND = "bench paper"
SEEDS = 20


class PaperRow(Struct, frozen=True):
    """One printed row: a property of a figure over all runs."""

    name: str
    value: float | None
    """Worst value of all runs; None if no run has a value."""
    unit: str
    bar: str
    ratio: float | None
    """Value divided by the number in `bar`; None without a value or with a bar of 0."""
    holds: int
    """Number of runs in which the property holds, out of the `of` runs that have a value."""
    of: int
    ok: bool


class PaperRun(Struct, frozen=True):
    """Findings on one run, and what is kept of it and of its iteration 2."""

    scenario: str
    seed: int
    findings: tuple[Finding, ...]
    kept: tuple[Kept, ...]


def run(as_json: bool, seeds: int = SEEDS, jobs: int = 1, keep: Keep | None = None) -> int:
    """Print the rows; return 0 if every property holds for every seed, else 1. `keep` holds the runs' results."""
    rows = rows_of(_runs(seeds, jobs) if keep is None else _kept(seeds, jobs, keep))
    if as_json:
        print(msgspec.json.encode({"rows": rows}).decode())
    else:
        print("\n".join(map(line, rows)))
        print(f"{len(rows)} rows, {sum(not row.ok for row in rows)} below the bar")
    return 0 if all(row.ok for row in rows) else 1


def one(scenario: str, seed: int) -> PaperRun:
    """Simulate one run and its iteration 2; return the findings on the first and the kept data of both.

    The run folders are removed.
    """
    from lfa.deploy.analysis.paper.checks import of_run
    from lfa.deploy.analysis.run_data import Run
    from lfa.deploy.run.load import rebuild_scenario
    from lfa.deploy.run.simulate import run as simulate

    folder = Path(tempfile.mkdtemp(prefix="lfa-paper-"))
    try:
        chosen, _ = rebuild_scenario(scenario, (), None, seed, None)
        first = Run(simulate(chosen, seed, folder / "first").folder)
        known, _ = rebuild_scenario(scenario, (), None, seed, first.folder)
        second = Run(simulate(known, seed, folder / "second").folder)
        keep = (across_seeds.keep(first), across_seeds.keep(second))
        return PaperRun(scenario, seed, tuple(of_run(first)), keep)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _runs(seeds: int, jobs: int) -> Iterator[PaperRun]:
    """Yield the runs of both paths as they end."""
    with workers(jobs) as pool:
        waiting = [pool.submit(one, path, seed) for seed in range(1, seeds + 1) for path in PATHS]
        for number, future in enumerate(waiting, start=1):
            done = future.result()
            print(f"{number} of {len(waiting)}: {_line(done)}", file=sys.stderr, flush=True)
            yield done


def _kept(seeds: int, jobs: int, keep: Keep) -> list[PaperRun]:
    """Do the share of the runs that `keep` names; return all whose results are there."""
    names = [(path, seed) for seed in range(1, seeds + 1) for path in PATHS]
    items = [Item(name_of([KIND, *name]), f"{name[0]}, seed {name[1]}", partial(_done, *name)) for name in names]
    kept, _ = do_share(keep.out, campaign_of(KIND, f"lfa {KIND}", items), items, keep.shard, jobs)
    return [msgspec.convert(result.data, PaperRun) for result in kept.results()]


def _done(scenario: str, seed: int) -> ItemResult:
    done = one(scenario, seed)
    return ItemResult(msgspec.to_builtins(done), "; ".join(_failures(done)))


def _failures(done: PaperRun) -> list[str]:
    return [f"{f.name} = {f.value:g} ({f.note})" for f in done.findings if f.status == "fails"]


def _line(done: PaperRun) -> str:
    failed = _failures(done)
    return f"{done.scenario}, seed {done.seed}: {'fails: ' + '; '.join(failed) if failed else 'ok'}"


def rows_of(runs: Iterable[PaperRun]) -> list[PaperRow]:
    """Return the rows over all runs, and those that compare the two paths."""
    kept: list[Kept] = []
    found: dict[str, dict[str, list[Finding]]] = {path: {} for path in PATHS}
    for done in runs:
        kept += done.kept
        for finding in done.findings:
            found[done.scenario].setdefault(f"{finding.figure} {finding.name}", []).append(finding)
    rows = [_row(f"{path} {name}", several) for path in PATHS for name, several in found[path].items()]
    return rows + [_row(f"both {finding.figure} {finding.name}", [finding]) for finding in across_seeds.across(kept)]


def _row(name: str, found: Sequence[Finding]) -> PaperRow:
    judged = [one for one in found if one.value is not None]
    holds = sum(one.status == "ok" for one in judged)
    worst = max(judged, key=_badness, default=None)
    value = None if worst is None else worst.value
    ratio = None if value is None else _over_bar(value, found[0].bar)
    return PaperRow(name, value, found[0].unit, found[0].bar, ratio, holds, len(judged), holds == len(judged))


def _over_bar(value: float, bar: str) -> float | None:
    """Return the value divided by the number in `bar` ("< 0.02 m"), to four digits; None with a bar of 0."""
    _, number, *_ = bar.split()
    return None if float(number) == 0.0 else float(f"{value / float(number):.4g}")


def _badness(finding: Finding) -> float:
    """Return how far a value is on the failing side of its bar."""
    assert finding.value is not None
    rule, bar, *_ = finding.bar.split()
    off = finding.value - float(bar)
    return abs(off) if rule == "=" else off if rule.startswith("<") else -off


def line(row: PaperRow) -> str:
    value = "-" if row.value is None else f"{row.value:.4g}"
    mark = "ok" if row.ok else "BELOW THE BAR"
    return f"{row.name:<64}{value:>10} {row.unit:<4} bar {row.bar:<11} {row.holds:>3} of {row.of:<3} {mark}"
