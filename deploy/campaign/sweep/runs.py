"""Runs of a plan as items of a campaign, and one run, done."""

from __future__ import annotations

from functools import partial

import msgspec
from msgspec import Struct

from lfa.deploy.analysis.summary import ENDED_WELL, Summary
from lfa.deploy.campaign.folder import Campaign
from lfa.deploy.campaign.items import Item, ItemResult
from lfa.deploy.campaign.sweep.metrics import metrics_of
from lfa.deploy.campaign.sweep.plan import SweepPlan, run_name
from lfa.deploy.campaign.work import campaign_of
from lfa.deploy.faults.script import parse_all
from lfa.deploy.own_code import OwnFile, load_files
from lfa.deploy.recording.run_folder import toml
from lfa.deploy.run.simulate import measure
from lfa.world.description.load import Scenario

KIND = "sweep"


class GroupFacts(Struct, frozen=True):
    """What a merge needs of a group."""

    values: tuple[str, ...]
    faults: tuple[str, ...]
    command: str
    own_code: tuple[OwnFile, ...]
    """Plug-ins that are not installed."""
    scenario: str
    """Scenario in TOML, with every field; `draw` varies it by the seed."""


class SweepFacts(Struct, frozen=True):
    """What a merge needs of a plan. Runs are numbered by group, then by seed, then by repetition."""

    scenario: str
    axes: tuple[str, ...]
    seeds: tuple[int, ...]
    repetitions: int
    groups: tuple[GroupFacts, ...]


class SweepResult(Struct, frozen=True):
    """Result of one run; `ok` as the exit code of `lfa sim` would say."""

    outcome: str
    ok: bool
    metrics: dict[str, float]


def items_of(plan: SweepPlan) -> list[Item]:
    """Return the runs of a plan in their order: by group, then by seed, then by repetition."""
    return [
        Item(
            run_name(group, seed, repetition),
            f"{group.command} --seed {seed}",
            partial(done, group.scenario, seed, group.faults, group.own_code),
        )
        for group in plan.groups
        for seed in plan.seeds
        for repetition in range(1, plan.repetitions + 1)
    ]


def describe(plan: SweepPlan, items: list[Item]) -> Campaign:
    """Return the description of a plan's campaign."""
    groups = tuple(GroupFacts(g.values, g.faults, g.command, g.own_code, toml(g.scenario)) for g in plan.groups)
    facts = SweepFacts(plan.scenario, plan.axes, plan.seeds, plan.repetitions, groups)
    return campaign_of(KIND, plan.title, items, msgspec.to_builtins(facts))


def facts_of(campaign: Campaign) -> SweepFacts:
    """Return the facts of a sweep's campaign."""
    return msgspec.convert(campaign.about, SweepFacts)


def done(scenario: Scenario, seed: int, faults: tuple[str, ...], own_code: tuple[OwnFile, ...] = ()) -> ItemResult:
    """Do one run and return its result. Nothing of it is recorded. `own_code`: its plug-ins that are not installed."""
    load_files(own_code)
    measured = measure(scenario, seed, parse_all(scenario.mission, scenario.faults, faults))
    summary = measured.summary
    result = SweepResult(summary.outcome, summary.exit_code == 0, metrics_of(summary, measured.seen))
    return ItemResult(msgspec.to_builtins(result), complaint_of(summary))


def complaint_of(summary: Summary) -> str:
    """Return why the exit code of a run is not 0; empty if it is."""
    if summary.exit_code == 0:
        return ""
    failed = [f"{one.name} ({one.text})" if one.text else one.name for one in summary.assertions if not one.ok]
    reason = [] if summary.outcome in ENDED_WELL else [f"{summary.outcome}: {summary.reason or 'no reason given'}"]
    return "; ".join(reason + failed)
