"""A plan, carried out: its share of runs, and when that is all of them, the merged results."""

from __future__ import annotations

from pathlib import Path

from lfa.deploy.campaign.commands.merge import merge
from lfa.deploy.campaign.shard import WHOLE, Shard
from lfa.deploy.campaign.sweep.plan import SweepPlan
from lfa.deploy.campaign.sweep.runs import describe, items_of
from lfa.deploy.campaign.work import do_share
from lfa.deploy.recording.run_folder import RUNS


def carry_out(plan: SweepPlan, out: Path | None, shard: Shard, jobs: int, as_json: bool) -> int:
    """Do the share of the plan's runs in `out`, by default a folder named by the plan; return the exit code.

    It is 1 if a run failed. Raises Refused for a folder of something else.
    """
    items = items_of(plan)
    campaign = describe(plan, items)
    folder, failed = do_share(out or RUNS / f"{plan.title}-{campaign.plan}", campaign, items, shard, jobs)
    merged = merge([folder.path], None, as_json) if shard == WHOLE else 0
    return max(merged, 1 if failed else 0)
