"""`lfa bench controllers`: every installed controller on the same seeds, with and without loss: a leaderboard.

A sweep of the scenario `figure_eight` with noisy localization and odometry. Errors, amplification per hop and spacing
are medians over the seeds with bootstrap intervals; controllers are ranked by the error under loss. The page is written
to the folder of the results, by default to `runs/controllers`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
from msgspec import Struct

from lfa.agents.following.controller import CONTROLLERS
from lfa.deploy.bench.harness.kept import Keep
from lfa.deploy.campaign.combine import Combined
from lfa.deploy.campaign.merge import sweep
from lfa.deploy.campaign.merge.merged_runs import MergedSweep, interval, read, values_of
from lfa.deploy.campaign.merge.page import Section, rows
from lfa.deploy.campaign.merge.report import PAGE, MergeReport, written
from lfa.deploy.campaign.sweep.metrics import METRICS
from lfa.deploy.campaign.sweep.plan import SweepPlan, plan_of
from lfa.deploy.campaign.sweep.runs import describe, items_of
from lfa.deploy.campaign.work import do_share
from lfa.protocol.config_file.toml_file import TomlFile

SEEDS = 10
LOSS = 0.2
TIME_S = 40.0
SET = {
    "time_limit_s": TIME_S,
    "world.noise.localization_m": 0.01,
    "world.noise.localization_rad": 0.01,
    "world.noise.odometry": 0.02,
}
SHOWN = ("distance_error_rms_m", "bearing_error_rms_rad", "hop_l2", "hop_linf", "distance_error_max_m")
WORST = "separation_min_m"
OUT = Path("runs") / "controllers"


class LeaderboardRow(Struct, frozen=True):
    """Row of the leaderboard: one controller under one loss."""

    controller: str
    loss: str
    runs: int
    good: int
    values: tuple[str, ...]
    """Median and interval of each quantity of `SHOWN`."""
    worst_spacing_m: float | None
    """Least distance between two robots in any run."""
    rank_by: float


def run(as_json: bool, seeds: int = SEEDS, jobs: int = 1, keep: Keep | None = None) -> int:
    """Print the leaderboard and write its page; return 0 if every run was good, else 1."""
    if keep is None:
        with tempfile.TemporaryDirectory(prefix="lfa-controllers-") as folder:
            return _run(as_json, seeds, jobs, Keep(Path(folder)), OUT, lasting=False)
    return _run(as_json, seeds, jobs, keep, keep.out / "merged", lasting=True)


def _run(as_json: bool, seeds: int, jobs: int, keep: Keep, out: Path, *, lasting: bool) -> int:
    plan = plan_for(seeds)
    items = items_of(plan)
    campaign = describe(plan, items)
    kept, _ = do_share(keep.out, campaign, items, keep.shard, jobs, lasting=lasting)
    combined = Combined(campaign, {result.name: result for result in kept.results()})
    report = report_of(combined)
    out.mkdir(parents=True, exist_ok=True)
    written(combined, report, out)
    if as_json:
        print(msgspec.json.encode({"rows": standings(read(combined)), "page": str(out / PAGE)}).decode())
    else:
        print("\n".join(report.lines))
        print(out / PAGE)
    return 1 if report.failed or combined.missing else 0


def plan_for(seeds: int) -> SweepPlan:
    """Return the sweep: the installed controllers, without and with loss, on the seeds 1 to `seeds`."""
    document = {
        "title": "Controllers",
        "scenario": "figure_eight",
        "seeds": f"1..{seeds}",
        "controllers": CONTROLLERS.installed(),
        "set": SET,
        "grid": {"radio.loss": [0.0, LOSS]},
        "assert": {"goal_reached": False, "contacts_max": 0},
    }
    return plan_of(TomlFile(Path("controllers"), document, {}))


def standings(merged: MergedSweep) -> list[LeaderboardRow]:
    """Return the leaderboard: under the loss first, the controller with the least median distance error first."""
    return sorted(_standings(merged), key=lambda row: (row.loss == "0", row.rank_by))


def _standings(merged: MergedSweep) -> Iterator[LeaderboardRow]:
    by_name = {metric.name: metric for metric in METRICS}
    for n, group in enumerate(merged.facts.groups):
        runs = merged.of_group(n)
        errors = values_of(runs, by_name[SHOWN[0]])
        spacing = values_of(runs, by_name[WORST])
        yield LeaderboardRow(
            controller=group.values[0],
            loss=group.values[1],
            runs=len(runs),
            good=sum(one.result.ok for one in runs),
            values=tuple(interval(values_of(runs, by_name[name]), f"{merged.labels[n]} {name}") for name in SHOWN),
            worst_spacing_m=min(spacing.values(), default=None),
            rank_by=float(np.median(list(errors.values()))) if errors else float("inf"),
        )


def report_of(combined: Combined) -> MergeReport:
    """Return the leaderboard, followed by everything that a merged sweep shows."""
    whole = sweep.report(combined)
    heads = ("controller", "loss", "runs", "good", *SHOWN, "worst spacing [m]")
    body = [(s.controller, s.loss, s.runs, s.good, *s.values, _short(s)) for s in standings(read(combined))]
    note = (
        "<p class='soft'>Ranked by the median rms distance error of the worst follower under loss. hop_l2, hop_linf: "
        "amplification of the distance error per hop, rms and peak. Worst spacing: least distance of two robots in any "
        "run. –: in no run did every follower come to stay within 5 cm of its slot, as under a controller that keeps a "
        "time headway.</p>"
    )
    board = Section("Leaderboard", rows(heads, body, text=(0,)) + note)
    widths = [max(len(str(row[n])) for row in (heads, *body)) for n in range(len(heads))]
    lines = tuple("  ".join(str(c).ljust(w) for c, w in zip(row, widths, strict=True)) for row in (heads, *body))
    return msgspec.structs.replace(whole, sections=(board, *whole.sections), lines=lines, worst=())


def _short(row: LeaderboardRow) -> str:
    return "–" if row.worst_spacing_m is None else f"{row.worst_spacing_m:.3f}"
