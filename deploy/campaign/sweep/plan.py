"""Plan of a sweep: one TOML file, read strictly, and the groups of equal runs that it means.

A plan is the same list of runs on every machine: each run is named by a hash of its whole scenario, faults and seed.
"""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct, field

from lfa.deploy.campaign.items import name_of
from lfa.deploy.campaign.sweep import axes as axes_of
from lfa.deploy.campaign.sweep.axes import Axis, AxisValue
from lfa.deploy.faults.script import COMMON, parse_all
from lfa.deploy.own_code import OwnFile, chosen_files, options_of
from lfa.deploy.recording.run_folder import toml_value
from lfa.deploy.scenario_loading import load_scenario
from lfa.protocol.config_file.conversion import convert
from lfa.protocol.config_file.mistake import FileError, Mistake, RefusedFile, overlap, wrong
from lfa.protocol.config_file.toml_file import TomlFile, read_toml
from lfa.protocol.errors import Refused
from lfa.protocol.names import whole_number
from lfa.world.description.load import Scenario
from lfa.world.description.placement import SEED_MAX

RUNS_MAX = 100_000
"""Default of `--max-runs`."""
REPETITIONS_MAX = 100
NO_SUCH = "no such key"
SEEDS_MAX = 1_000_000


class PlanFile(Struct, frozen=True, forbid_unknown_fields=True):
    """Keys of a plan."""

    scenario: str
    """A shipped scenario, or a file beside the plan."""
    seeds: Any = "1..1"
    """Seeds as `"1..100"`, or a list of them."""
    title: str = ""
    robots: int | None = None
    """Team size N, for a team 1..N instead of the scenario's."""
    controllers: tuple[str, ...] | None = None
    """Names of controllers, each a group."""
    faults: tuple[tuple[str, ...], ...] | None = None
    """Lists of faults, each a group: `[[], ["kill leader at 5 s"]]`."""
    repetitions: int = 1
    """Number of times that each run is done: a repetition must give the same result, on whichever machine."""
    set: Any = field(default_factory=dict)
    """Scenario keys that are the same in all runs."""
    grid: Any = None
    """Scenario keys with lists of values; every combination is a group."""
    list: Any = None
    """`[[list]]`: scenario keys with lists of values that change together, row by row."""
    asserted: Any = field(default_factory=dict, name="assert")
    """Assertions, as in a scenario's `[assert]`."""


class Group(Struct, frozen=True):
    """Runs that differ in nothing but their seeds."""

    values: tuple[str, ...]
    """Text of the value of each axis."""
    scenario: Scenario
    faults: tuple[str, ...]
    command: str
    """Command line of a run of the group, without its seed."""
    own_code: tuple[OwnFile, ...] = ()
    """Plug-ins that are not installed."""
    code_hash: str = ""
    """Hash of their files."""

    @property
    def label(self) -> str:
        return ", ".join(self.values) or "all"


class SweepPlan(Struct, frozen=True):
    """Checked plan."""

    title: str
    scenario: str
    axes: tuple[str, ...]
    """Name of each axis."""
    seeds: tuple[int, ...]
    repetitions: int
    groups: tuple[Group, ...]

    @property
    def runs(self) -> int:
        return len(self.groups) * len(self.seeds) * self.repetitions


def read_plan(path: Path, runs_max: int = RUNS_MAX) -> SweepPlan:
    """Read and check the plan at `path`. Raises RefusedFile with all of its mistakes, each with its line."""
    file = read_toml(path, "a plan of a campaign")
    return plan_of(file, runs_max)


def plan_of(file: TomlFile, runs_max: int = RUNS_MAX) -> SweepPlan:
    """Check the document of `file` and return the plan that it means. Raises RefusedFile."""
    keys, mistakes = convert(file.document, PlanFile)
    seeds = _seeds(keys.seeds, mistakes)
    axes, fixed = _axes(keys, mistakes)
    _count(seeds, keys, axes, runs_max, mistakes)
    if mistakes:
        raise file.refuse(mistakes)
    groups = _groups(file, keys, axes, fixed)
    return SweepPlan(
        title=keys.title or file.path.stem,
        scenario=groups[0].scenario.name,
        axes=tuple(axis.name for axis in axes),
        seeds=seeds,
        repetitions=keys.repetitions,
        groups=groups,
    )


def parse_seeds(text: str, where: str = "--seeds") -> tuple[int, ...]:
    """Return the seeds of `1..100`, of `3` or of `1,5,9`. Raises Refused for another text."""
    found: list[int] = []
    for part in text.split(","):
        first, dots, last = part.strip().partition("..")
        low, high = whole_number(first), whole_number(last if dots else first)
        if low is None or high is None or not low <= high <= SEED_MAX or len(found) + high - low >= SEEDS_MAX:
            raise Refused(f"{where} {text}: must be like 1..100 or 1,5,9: at most {SEEDS_MAX} seeds up to {SEED_MAX}")
        found += range(low, high + 1)
    if len(set(found)) < len(found):
        raise Refused(f"{where} {text}: a seed stands there twice: must stand there once")
    return tuple(found)


def _seeds(given: object, mistakes: list[Mistake]) -> tuple[int, ...]:
    right = 'a text such as "1..100", or a list of different whole numbers'
    if isinstance(given, str):
        try:
            return parse_seeds(given, "seeds =")
        except Refused:
            mistakes.append(wrong("seeds", given, f"{right}: at most {SEEDS_MAX} seeds up to {SEED_MAX}"))
            return (1,)
    good = isinstance(given, list) and bool(given) and all(type(one) is int for one in given)
    if not isinstance(given, list) or not good or len(set(given)) < len(given):
        mistakes.append(wrong("seeds", given, right))
        return (1,)
    mistakes += [
        wrong(f"seeds[{n}]", one, f"a number from 0 to {SEED_MAX}")
        for n, one in enumerate(given)
        if not 0 <= one <= SEED_MAX
    ]
    return tuple(given)


def _axes(keys: PlanFile, mistakes: list[Mistake]) -> tuple[list[Axis], list[tuple[str, str, Any]]]:
    """Return the axes and the fixed keys (key, place in the plan, value); add the mistakes in them."""
    axes: list[Axis] = []
    if _distinct("controllers", keys.controllers, mistakes):
        axes.append(axes_of.controller_axis(keys.controllers or ()))
    if _distinct("faults", keys.faults, mistakes):
        axes.append(axes_of.fault_axis(keys.faults or ()))
    for table, read in ((keys.grid, axes_of.grid_axes), (keys.list, axes_of.list_axes)):
        if table is not None:
            found, wrongs = read(table)
            axes += found
            mistakes += wrongs
    fixed: list[tuple[str, str, Any]] = []
    for name, table in (("set", keys.set), ("assert", keys.asserted)):
        if not isinstance(table, dict):
            mistakes.append(wrong(name, table, "a table of keys and values"))
            continue
        prefix = "assert." if name == "assert" else ""
        fixed += [(f"{prefix}{key}", where, value) for key, where, value in axes_of.flat(table, name)]
    mistakes += axes_of.shared_keys(axes, [(key, where) for key, where, _ in fixed])
    return axes, fixed


def _distinct(name: str, given: Sequence[object] | None, mistakes: list[Mistake]) -> bool:
    """Return True for a list that makes an axis; one that is empty, or has an entry twice, is a mistake."""
    if given is None:
        return False
    good = bool(given) and len(set(given)) == len(given)
    if not good:
        mistakes.append(wrong(name, list(given), "at least one entry, and none twice"))
    return good


def _count(seeds: Sequence[int], keys: PlanFile, axes: Sequence[Axis], runs_max: int, mistakes: list[Mistake]) -> None:
    if not 1 <= keys.repetitions <= REPETITIONS_MAX:
        mistakes.append(wrong("repetitions", keys.repetitions, f"a number from 1 to {REPETITIONS_MAX}"))
        return
    groups = axes_of.count(axes)
    runs = groups * len(seeds) * keys.repetitions
    if runs > runs_max:
        text = f"{groups} groups, {len(seeds)} seeds and {keys.repetitions} repetitions are {runs} runs"
        mistakes.append(Mistake("seeds", f": {text}: must be at most {runs_max} (--max-runs)"))


def _groups(
    file: TomlFile, keys: PlanFile, axes: Sequence[Axis], fixed: Sequence[tuple[str, str, Any]]
) -> tuple[Group, ...]:
    """Load the scenario of each combination. Raises RefusedFile with the mistakes of all of them."""
    name = str(file.path.parent / keys.scenario) if keys.scenario.endswith(".toml") else keys.scenario
    try:
        load_scenario(name, (), keys.robots)
    except RefusedFile:
        pass  # named below, unless the plan sets right what is wrong
    except Refused as refused:
        raise file.refuse([Mistake("scenario", f": {refused}")]) from None
    groups: list[Group] = []
    errors: dict[str, FileError] = {}
    for chosen in axes_of.combinations(axes):
        sets = [*fixed, *((key, value.where, setting) for value in chosen for key, setting in value.sets)]
        try:
            groups.append(_group(name, keys.robots, chosen, [(key, value) for key, _, value in sets]))
        except RefusedFile as refused:
            for error in refused.errors:
                placed = _in_plan(file, error, sets)
                # Of a key that no scenario has, its values are no mistakes of their own.
                place = f"{placed.file}:{placed.line}:{error.key}"
                errors.setdefault(place if NO_SUCH in placed.text else str(placed), placed)
        except Refused as refused:
            place = next((value.where for value in chosen if value.faults), "scenario")
            placed = file.error(Mistake(place, f": {refused}"))
            errors.setdefault(str(placed), placed)
    if errors:
        raise RefusedFile(errors.values())
    return tuple(groups)


def _group(name: str, robots: int | None, chosen: Sequence[AxisValue], sets: Sequence[tuple[str, Any]]) -> Group:
    overrides = [f"{key}={toml_value(value)}" for key, value in sets]
    scenario = load_scenario(name, overrides, robots)
    faults = tuple(fault for value in chosen for fault in value.faults)
    common = next((f for f in parse_all(scenario.mission, scenario.faults, faults) if f.target in COMMON), None)
    if common is not None:
        raise Refused(f"fault '{common}': only in lfa run, in a simulation {common.target} is no process")
    words = [name, *([] if robots is None else ["--robots", str(robots)])]
    words += [word for override in overrides for word in ("--set", override)]
    words += [word for fault in faults for word in ("--fault", fault)]
    own_code = chosen_files(scenario)
    words += options_of(own_code, ("controller", "behavior", "sensor"))
    return Group(
        values=tuple(value.text for value in chosen),
        scenario=scenario,
        faults=faults,
        command="lfa sim " + shlex.join(words),
        own_code=own_code,
        code_hash=_hash(own_code),
    )


def _hash(own_code: Sequence[OwnFile]) -> str:
    return " ".join(hashlib.sha256(file.path.read_bytes()).hexdigest() for file in own_code)


def _in_plan(file: TomlFile, error: FileError, sets: Sequence[tuple[str, str, Any]]) -> FileError:
    """Return a mistake of the scenario with its place in the plan, if the plan set one of the keys."""
    where = next((where for key, where, _ in reversed(sets) if error.key and overlap((error.key,), (key,))), None)
    return error if where is None else FileError(str(file.path), error.text, file.line(where), where)


def run_name(group: Group, seed: int, repetition: int) -> str:
    """Return the name of one run: a hash of everything that its result depends on."""
    return name_of([msgspec.to_builtins(group.scenario), group.faults, group.code_hash, seed, repetition])
