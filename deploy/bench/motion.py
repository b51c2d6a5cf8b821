"""`lfa bench motion`: complete teams in virtual time, on every ground that driving is judged by.

The rows: every shipped scenario; the BARN worlds (`lfa bench barn`, and with the noise of `explore`); gaps, traps,
corners and a closing door; worlds, teams and scanners at random; whatever moves; maps that nobody knows; the time to
the goal over the shortest possible one on known ground; the time of one control step. A run is good if it ends at its
goal without contact, without a violated invariant and without a robot left behind. What falls short is listed by cause,
each run with its folder, in which `lfa why`, `lfa plot` and `lfa view` show it again. Maps and worlds of others are
searched in `shared`, beside the checkout or above it; without them their rows are skipped with a message.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from fnmatch import fnmatchcase
from functools import partial
from math import ceil
from pathlib import Path
from random import Random
from time import strftime

from lfa.deploy.bench import barn
from lfa.deploy.bench.driving import courses, drawn_worlds, fastest_way, movers, step_time, unknown_maps
from lfa.deploy.bench.driving.course_file import course_text
from lfa.deploy.bench.driving.courses import CourseKind
from lfa.deploy.bench.driving.fastest_way import TimedKind
from lfa.deploy.bench.driving.movers import MoverKind
from lfa.deploy.bench.driving.one_run import complaint, driven, loaded, note, show_failures
from lfa.deploy.bench.driving.unknown_maps import BenchMap
from lfa.deploy.bench.harness.kept import Keep, measured_or_kept
from lfa.deploy.bench.harness.rows import Case, CasePart, Quantity, many, select, show
from lfa.deploy.recording.run_folder import RUNS
from lfa.protocol.errors import Refused

SEEDS = 10
"""Runs of each shipped scenario, course and body, where the command line gives no number."""
MOVER_SEEDS = 20
DRAWN_SEEDS = 100
GOOD_SHARE = 0.98
WAY_RATIO_MAX = 1.4
STEP_MS_MAX = 1.5


def run(as_json: bool, rows: str = "*", jobs: int = 1, seeds: int | None = None, keep: Keep | None = None) -> int:
    """Print the rows whose names match the glob `rows`, then the failures by cause; return 0 if all hold, else 1."""
    failed = RUNS / f"motion-{strftime('%Y%m%d-%H%M%S')}"
    code = show(measured_or_kept("motion", select(cases(seeds, failed, rows), rows), jobs, rows, keep), as_json)
    show_failures(failed, as_json)
    return code


def cases(seeds: int | None, failed: Path, rows: str = "*") -> list[Case]:
    """Return the cases: `seeds` runs of each, or of pairs and worlds; None: the numbers that the bars need.

    Failing runs leave their folders in `failed`. What lacks its file is left out, with a line where `rows` names it.
    """
    return [
        *_scenarios(seeds or SEEDS, failed),
        *_barn(seeds, failed, rows),
        *(
            _course(kind, motion, radius_m, seeds or SEEDS, failed)
            for kind in courses.KINDS
            for motion in kind.motions
            for radius_m in kind.radii_m
        ),
        _drawn(seeds or DRAWN_SEEDS, failed),
        *(_mover(kind, motion, seeds or MOVER_SEEDS, failed) for kind in movers.KINDS for motion in movers.MOTIONS),
        *_unknown(seeds, failed, rows),
        *(_timed(kind, seeds or SEEDS, failed) for kind in fastest_way.KINDS),
        Case("step/180 beams", (Quantity("p99", "ms", STEP_MS_MAX),), step_time.step_ms),
    ]


def _scenarios(seeds: int, failed: Path) -> Iterator[Case]:
    from lfa.world.description.load import shipped

    all_good = Quantity(f"good of {seeds}", "runs", float(seeds), "at least")
    for name in shipped():
        parts = [CasePart(seed, partial(run_good, name, failed, seed)) for seed in range(1, seeds + 1)]
        yield many(f"scenario/{name}", (all_good,), parts)


def run_good(name: str, failed: Path, seed: int) -> list[float]:
    """Return 1 if the run of the shipped scenario is good, else 0."""
    from lfa.world.description.load import load

    with driven(load(name), seed) as done:
        wrong = complaint(done.summary)
        note(f"scenario/{name}", done, wrong, failed)
    return [float(wrong is None)]


def _barn(seeds: int | None, failed: Path, rows: str) -> list[Case]:
    try:
        return barn.cases(seeds, None, failed)
    except Refused as refused:
        _left_out("barn/one", rows, str(refused))
        return []


def _course(kind: CourseKind, motion: str, radius_m: float, seeds: int, failed: Path) -> Case:
    name = f"course/{kind.name}/{motion}"
    if len(kind.radii_m) > 1:
        name += f"/r {radius_m:g}"
    good = Quantity(f"good of {seeds}", "runs", float(seeds), "at least")
    parts = [
        CasePart(seed, partial(course_good, name, kind, motion, radius_m, failed, seed)) for seed in range(1, seeds + 1)
    ]
    return many(name, (good,), parts)


def course_good(name: str, kind: CourseKind, motion: str, radius_m: float, failed: Path, seed: int) -> list[float]:
    """Return 1 if the run through the course that the seed draws is good, else 0."""
    course = kind.draw(Random(f"{kind.name} {seed}"), radius_m)
    text = course_text(name, course, motion, sets=(f"radius_m = {radius_m:g}",))
    with driven(loaded(kind.name, text), seed) as done:
        wrong = complaint(done.summary)
        note(name, done, wrong, failed)
    return [float(wrong is None)]


def _drawn(seeds: int, failed: Path) -> Case:
    good = Quantity(f"good of {seeds}", "runs", float(ceil(GOOD_SHARE * seeds)), "at least")
    return many("drawn", (good,), [CasePart(seed, partial(drawn_good, failed, seed)) for seed in range(1, seeds + 1)])


def drawn_good(failed: Path, seed: int) -> list[float]:
    """Return 1 if the run in the world that the seed draws is good and nobody touches anything, else 0."""
    world = drawn_worlds.drawn(seed)
    text = course_text("drawn", world.course, world.motion, world.robots)
    with driven(loaded("drawn", text, world.sets), seed) as done:
        wrong = complaint(done.summary)
        note("drawn", done, wrong, failed)
    return [float(wrong is None)]


def _mover(kind: MoverKind, motion: str, seeds: int, failed: Path) -> Case:
    name = f"mover/{kind.name}/{motion}"
    quantities = (
        Quantity(f"good of {seeds}", "runs", float(seeds), "at least"),
        Quantity("contacts to blame", "", 0.0),
    )
    parts = [CasePart(seed, partial(mover_good, name, kind, motion, failed, seed)) for seed in range(1, seeds + 1)]
    return many(name, quantities, parts)


def mover_good(name: str, kind: MoverKind, motion: str, failed: Path, seed: int) -> list[float]:
    """Return 1 if the run among the movers that the seed draws is good, else 0, and the contacts that count."""
    course, mps = movers.drawn(kind, seed)
    scenario = loaded(kind.name, course_text(f"{name} at {mps:g} m/s", course, motion))
    with driven(scenario, seed) as done:
        wrong, counted = movers.wrong_of(done, faster=mps > scenario.mission.limits.v_max_mps)
        note(f"{name} at {mps:g} mps", done, wrong, failed)
    return [float(wrong is None), float(counted)]


def _unknown(seeds: int | None, failed: Path, rows: str) -> Iterator[Case]:
    for ground in unknown_maps.GROUNDS:
        name, count = f"unknown/{ground.name}", seeds or ground.pairs
        if unknown_maps.map_of(ground) is None:
            _left_out(name, rows, f"no shared/{ground.place} beside the checkout or above it")
            continue
        quantities = (
            Quantity(f"good of {count}", "runs", float(ceil(GOOD_SHARE * count)), "at least"),
            Quantity("way over the shortest known", "", WAY_RATIO_MAX, over="mean"),
        )
        parts = [CasePart(n, partial(pair_good, ground, count, failed, n)) for n in range(1, count + 1)]
        yield many(name, quantities, parts)


def pair_good(ground: BenchMap, count: int, failed: Path, number: int) -> list[float]:
    """Return 1 if the run on the `number`-th of `count` random pairs is good, else 0, and the longest way of a robot
    over the shortest known one; the map may have fewer pairs.
    """
    from lfa.world.description.load import load

    drawn = unknown_maps.pairs(ground, count)
    if number > len(drawn):
        return [0.0, 1.0]
    pair = drawn[number - 1]
    scenario = load("explore", pair, ground.robots)
    with driven(scenario, number) as done:
        wrong = complaint(done.summary)
        note(f"unknown/{ground.name}", done, wrong, failed)
        way_m = max(robot.way_m or 0.0 for robot in done.summary.robots if robot.role_at_end == "leader")
    return [float(wrong is None), way_m / unknown_maps.shortest_on(ground, pair, scenario.mission.radius_m)]


def _timed(kind: TimedKind, seeds: int, failed: Path) -> Case:
    quantities = (
        Quantity(f"good of {seeds}", "runs", float(seeds), "at least"),
        Quantity("time over the shortest possible", "", kind.ratio_max, over="mean"),
    )
    parts = [CasePart(seed, partial(timed_good, kind, failed, seed)) for seed in range(1, seeds + 1)]
    return many(f"time/{kind.name}", quantities, parts)


def timed_good(kind: TimedKind, failed: Path, seed: int) -> list[float]:
    """Return 1 if the run of one robot is good and in time, else 0, and its time over the shortest possible one."""
    name = f"time/{kind.name}"
    timed = kind.draw(Random(f"{kind.name} {seed}"), fastest_way.RADIUS_M)
    scenario = loaded(kind.name, course_text(name, timed.course, "path_following", robots=1), timed.sets)
    with driven(scenario, seed) as done:
        took_s = done.summary.arrived_at_s or scenario.time_limit_s
        ratio = took_s / timed.least_s(scenario.mission.limits.a_max_mps2)
        late = f"{ratio:.2f} times the shortest possible time" if ratio > kind.ratio_max else None
        wrong = complaint(done.summary) or late
        note(name, done, wrong, failed)
    return [float(wrong is None), ratio]


def _left_out(name: str, rows: str, why: str) -> None:
    """Say that the rows of a case are left out, where the glob `rows` names them."""
    if fnmatchcase(name, rows) or fnmatchcase(f"{name}/", rows.rpartition("/")[0] + "/"):
        print(f"{name} is left out: {why}", file=sys.stderr)
