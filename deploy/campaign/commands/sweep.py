"""A plan, carried out: here, or in shares on an engine; when all of it is done, its results are merged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from msgspec import Struct

from lfa.deploy.campaign.commands.merge import merge
from lfa.deploy.campaign.engines.dispatch import engine, watch
from lfa.deploy.campaign.engines.share_command import share_commands
from lfa.deploy.campaign.folder import Campaign, open_folder
from lfa.deploy.campaign.shard import WHOLE, Shard
from lfa.deploy.campaign.sweep.plan import SweepPlan
from lfa.deploy.campaign.sweep.runs import describe, items_of
from lfa.deploy.campaign.work import do_share
from lfa.deploy.recording.run_folder import RUNS


class Remote(Struct, frozen=True):
    """Engine, and how the shares are submitted to it."""

    on: str
    shares: int
    jobs: int
    minutes: int
    """Time limit [min] of a share on Slurm."""
    slurm: Mapping[str, str]
    """Options of sbatch."""
    more: Sequence[str]
    """Options of `lfa campaign` that each share needs too."""


def carry_out(plan: SweepPlan, out: Path | None, shard: Shard, jobs: int, as_json: bool) -> int:
    """Do the share of the plan's runs in `out`, by default a folder named by the plan; return the exit code.

    It is 1 if a run failed. Raises Refused for a folder of something else.
    """
    items = items_of(plan)
    campaign = describe(plan, items)
    folder, failed = do_share(_folder(plan, campaign, out), campaign, items, shard, jobs)
    merged = merge([folder.path], None, as_json) if shard == WHOLE else 0
    return max(merged, 1 if failed else 0)


def carry_out_on(remote: Remote, path: Path, plan: SweepPlan, out: Path | None, as_json: bool) -> int:
    """Do the plan at `path` in shares on an engine, which must see the folder of the results; return the exit code."""
    campaign = describe(plan, items_of(plan))
    kept = open_folder(_folder(plan, campaign, out), campaign)
    kept.results()  # damaged ones are named before anything is submitted
    commands = share_commands(path, kept.path, remote.shares, remote.jobs, remote.more)
    with engine(remote.on, kept.path, commands, remote.minutes, remote.jobs, remote.slurm) as handles:
        lost = watch(handles, kept)
    return max(merge([kept.path], None, as_json), 1 if lost else 0)


def _folder(plan: SweepPlan, campaign: Campaign, out: Path | None) -> Path:
    return out or RUNS / f"{plan.title}-{campaign.plan}"
