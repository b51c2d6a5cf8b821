"""`lfa bench campaign`: how long 1000 runs of a 10 s scenario with four robots take, and how much two processes gain.

The 1000 runs are extrapolated from those that are done, as the row says. The ratio of two jobs to one needs two free
cores. The merge is of 1000 results, made up from that of one run.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import msgspec

from lfa.deploy.bench.harness.rows import Case, Quantity, measured, select, show
from lfa.deploy.campaign.combine import combine
from lfa.deploy.campaign.folder import open_folder
from lfa.deploy.campaign.items import Item, ItemResult
from lfa.deploy.campaign.merge import sweep
from lfa.deploy.campaign.merge.report import PAGE, written
from lfa.deploy.campaign.sweep.plan import SweepPlan, plan_of
from lfa.deploy.campaign.sweep.runs import describe, done, items_of
from lfa.deploy.campaign.work import do_share
from lfa.protocol.config_file.toml_file import TomlFile

RUNS = 24
MERGED_RUNS = 1000
RATIO_MIN = 1.8
MINUTES_MAX = 12.0
MERGE_S_MAX = 10.0
PAGE_MB_MAX = 5.0
MEGABYTE = 1e6


def run(as_json: bool, rows: str = "*", seeds: int = RUNS) -> int:
    """Print the rows; return 0 if all hold, else 1. `seeds` runs are timed, with one job and with two."""
    cases = [
        Case(
            "campaign/10 s, 4 robots",
            (
                Quantity(f"1000 runs with 2 jobs, from {seeds}", "min", MINUTES_MAX),
                Quantity("2 jobs over 1 job", "ratio", RATIO_MIN, "at least"),
            ),
            partial(speed, seeds),
        ),
        Case(
            "campaign/merge of 1000 runs",
            (Quantity("duration", "s", MERGE_S_MAX), Quantity("page", "MB", PAGE_MB_MAX)),
            merge_cost,
        ),
    ]
    return show(measured(select(cases, rows), 1, rows), as_json)


def plan_for(seeds: int) -> SweepPlan:
    """Return a plan of `seeds` runs in four groups."""
    document = {
        "scenario": "circle",
        "seeds": f"1..{max(1, seeds // 4)}",
        "controllers": ["law", "kanayama"],
        "set": {"time_limit_s": 10},
        "grid": {"radio.loss": [0.0, 0.2]},
        "assert": {"goal_reached": False},
    }
    return plan_of(TomlFile(Path("bench"), document, {}))


def speed(seeds: int) -> list[float]:
    """Return the time [min] that 1000 runs would take with two jobs, and how many times one job takes that."""
    items = items_of(plan_for(seeds))
    one_s, two_s = (_duration_s(items, jobs) for jobs in (1, 2))
    return [two_s / len(items) * MERGED_RUNS / 60.0, one_s / two_s]


def _duration_s(items: Sequence[Item], jobs: int) -> float:
    plan = plan_for(len(items))
    with tempfile.TemporaryDirectory(prefix="lfa-campaign-") as folder:
        began = time.perf_counter()
        do_share(Path(folder), describe(plan, items_of(plan)), items, jobs=jobs, lasting=False)
        return time.perf_counter() - began


def merge_cost() -> list[float]:
    """Return duration [s] and size of the page [MB] of a merge of 1000 runs, from a folder to all files."""
    plan = plan_for(MERGED_RUNS)
    items = items_of(plan)
    like = done(plan.groups[0].scenario, 1, ())
    with tempfile.TemporaryDirectory(prefix="lfa-campaign-") as folder:
        kept = open_folder(Path(folder), describe(plan, items))
        for n, item in enumerate(items):
            kept.store(item.name, _varied(like, n))
        began = time.perf_counter()
        combined = combine([kept.path])
        written(combined, sweep.report(combined), kept.path)
        return [time.perf_counter() - began, (kept.path / PAGE).stat().st_size / MEGABYTE]


def _varied(like: ItemResult, n: int) -> ItemResult:
    """Return a result with other values than `like`, so that intervals and distributions have something to do."""
    metrics = {name: value * (1.0 + 0.001 * (n % 97)) for name, value in like.data["metrics"].items()}
    return msgspec.structs.replace(like, data={**like.data, "metrics": metrics})
