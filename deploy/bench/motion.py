"""`lfa bench motion`: complete teams in virtual time in every shipped scenario, and on unknown maps.

Each case is one scenario over several seeds, or random pairs of start and goal on a map. A run is good if it ends at
its goal without contact, without a violated invariant and without a robot left behind; otherwise the cause is printed.
Maps of the Nav2 project are searched in `shared/data/maps`, beside the checkout or above it; without them their rows
are skipped with a message.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Sequence
from fnmatch import fnmatchcase
from functools import cache, partial
from math import ceil, hypot
from pathlib import Path
from random import Random

from msgspec import Struct

from lfa.deploy.analysis.summary import Summary
from lfa.deploy.bench.harness.kept import Keep, measured_or_kept
from lfa.deploy.bench.harness.rows import Case, CasePart, Quantity, many, select, show
from lfa.protocol.errors import Refused

SEEDS = 3
TRIES_MAX = 4000
FOUND_IN = Path("shared") / "data" / "maps"


class BenchMap(Struct, frozen=True):
    """Map that the robots do not know, and the parameters of the start and goal pairs drawn on it."""

    name: str
    shipped: bool = False
    robots: int = 4
    apart_m: float = 8.0
    """Minimum straight distance [m] between start and goal; no route is shorter."""
    clear_m: float = 0.45
    """Minimum clearance [m] of start and goal."""
    pairs: int = 20
    sets: tuple[str, ...] = ()


GOOD_SHARE = 0.9
GROUNDS = (
    BenchMap("rooms", shipped=True),
    BenchMap("depot"),
    BenchMap(
        "tb3_sandbox", robots=2, apart_m=3.0, clear_m=0.25, pairs=10, sets=("mission.formation.separation_m=0.6",)
    ),
)


def cases(seeds: int | None) -> list[Case]:
    """Return the cases: `seeds` runs per scenario and pairs per available map; None: the numbers that the bars need."""
    from lfa.world.description.load import shipped

    of_each = seeds or SEEDS
    all_good = Quantity("good", "runs", float(of_each), "at least")
    runs = [many(f"scenario/{name}", (all_good,), seeds_of(name, of_each)) for name in shipped()]
    return runs + [_unknown(ground, seeds or ground.pairs) for ground in GROUNDS if map_of(ground) is not None]


def _unknown(ground: BenchMap, count: int) -> Case:
    good = Quantity(f"good of {count}", "runs", float(ceil(GOOD_SHARE * count)), "at least")
    parts = [CasePart(number, partial(pair_good, ground, count, number)) for number in range(1, count + 1)]
    return many(f"unknown/{ground.name}", (good,), parts)


def map_of(ground: BenchMap) -> Path | None:
    """Return the path of the map's YAML file, or None if it does not exist."""
    from lfa.world.description.load import SCENARIOS

    if ground.shipped:
        return SCENARIOS / "maps" / f"{ground.name}.yaml"
    above = (*Path.cwd().parents, *Path(__file__).resolve().parents)
    return next((path for up in above if (path := up / FOUND_IN / f"{ground.name}.yaml").is_file()), None)


def run(
    as_json: bool, rows: str = "scenario/*", jobs: int = 1, seeds: int | None = None, keep: Keep | None = None
) -> int:
    """Print the rows whose names match the glob `rows`; return 0 if all hold, else 1."""
    for ground in GROUNDS:
        if map_of(ground) is None and fnmatchcase(f"unknown/{ground.name}", rows.rsplit("/good", 1)[0]):
            where = f"{FOUND_IN / ground.name}.yaml"
            print(f"unknown/{ground.name} is left out: no {where} beside the checkout or above it", file=sys.stderr)
    return show(measured_or_kept("motion", select(cases(seeds), rows), jobs, rows, keep), as_json)


def seeds_of(name: str, seeds: int) -> list[CasePart]:
    """Return a part for each of the seeds 1 to `seeds` of the scenario."""
    return [CasePart(seed, partial(run_good, name, seed)) for seed in range(1, seeds + 1)]


def run_good(name: str, seed: int) -> tuple[float]:
    """Return 1 if the run of the scenario is good, else 0."""
    return (float(_good(name, seed, ())),)


def pair_good(ground: BenchMap, count: int, number: int) -> tuple[float]:
    """Return 1 if the run on the `number`-th of `count` random pairs is good, else 0; the map may have fewer pairs."""
    drawn = pairs(ground, count)
    return (float(number <= len(drawn) and _good("explore", number, drawn[number - 1], ground.robots)),)


@cache
def pairs(ground: BenchMap, count: int) -> list[tuple[str, ...]]:
    """Return up to `count` random pairs in free space, each as arguments of `--set`.

    The scenario `explore` must load with each pair: the chain fits at the start, and a route leads to the goal.
    """
    from lfa.world.description import maps
    from lfa.world.description.load import load

    path = map_of(ground)
    assert path is not None, ground
    drawn = maps.read(path)
    room, chance, found = maps.Room(drawn), Random("pairs"), list[tuple[str, ...]]()
    free = [(int(row), int(column)) for row, column in zip(*(drawn.cells == 0).nonzero(), strict=True)]
    sets = ground.sets if ground.shipped else (f"map={path}", *ground.sets)
    for _ in range(TRIES_MAX):
        if len(found) == count:
            break
        a, b = (
            drawn.to_map((column + chance.random()) * drawn.resolution_m, (row + chance.random()) * drawn.resolution_m)
            for row, column in chance.choices(free, k=2)
        )
        clear_m = min(room.clearance_m(*a), room.clearance_m(*b))
        if hypot(a[0] - b[0], a[1] - b[1]) < ground.apart_m or clear_m < ground.clear_m:
            continue
        pair = (*sets, f"start={a[0]:.2f},{a[1]:.2f}", f"goal={b[0]:.2f},{b[1]:.2f}")
        try:
            load("explore", pair, ground.robots)
        except Refused:
            continue
        found.append(pair)
    return found


def _good(name: str, seed: int, sets: Sequence[str], robots: int | None = None) -> bool:
    from lfa.deploy.faults.script import parse_all
    from lfa.deploy.run.simulate import run as simulate
    from lfa.world.description.load import load

    scenario = load(name, sets, robots)
    folder = Path(tempfile.mkdtemp(prefix="lfa-motion-"))
    try:
        summary = simulate(scenario, seed, folder / "run", parse_all(scenario.mission, scenario.faults, ())).summary
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    if summary.outcome == "interrupted":  # a signal ended the run, so the bench ends too
        raise KeyboardInterrupt
    wrong = complaint(summary)
    options = ("" if robots is None else f" --robots {robots}") + "".join(f" --set {one}" for one in sets)
    ended = f"{wrong or 'ok'}, {summary.sim_duration_s:.0f} s"
    print(f"lfa sim {name} --seed {seed}{options}: {ended}", file=sys.stderr, flush=True)
    return wrong is None


def complaint(summary: Summary) -> str | None:
    """Return the reason why a run is not good, or None if it is good."""
    contacts = sum(robot.contacts for robot in summary.robots)
    if summary.exit_code != 0:
        return summary.reason or ", ".join(one.name for one in summary.assertions if not one.ok)
    if summary.violations:
        return ", ".join(one.invariant for one in summary.violations)
    if summary.left_behind:
        return f"left behind: {summary.left_behind}"
    return f"{contacts} contacts" if contacts else None
