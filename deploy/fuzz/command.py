"""`lfa fuzz`: search for fault schedules that violate an invariant; shrink, trace and reproduce them.

A seed determines the schedule and the run: the same seed on the same commit fails in the same way.
"""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import typer
from msgspec import Struct

from lfa.deploy.analysis.verification.checker import Violation
from lfa.deploy.fuzz.fault_injector import Played, play, play_whole
from lfa.deploy.fuzz.network import Trace
from lfa.deploy.fuzz.schedules import KINDS, Schedule, draw, without
from lfa.deploy.process.worker_pool import workers
from lfa.protocol.errors import Refused
from lfa.protocol.names import whole_number

Player = Callable[[Schedule, Trace | None], Played]

CHUNKS: dict[Player, int] = {play: 50, play_whole: 4}
"""Number of seeds per task of a worker process."""
SEEDS: dict[Player, str] = {play: "1000", play_whole: "60"}
"""Default of `--seeds`."""
KINDS_CLAIM_SEEDS = 60
"""Minimum number of seeds from which on every kind of fault must have taken effect."""
SEEDS_MAX = 100_000_000
FAILURES_SHOWN_MAX = 5
TELL_EVERY_S = 10.0
COLUMN = 30
SKIPPED = ("extends", "hello", "grant", "nack")
"""Prefixes of frequent trace lines that explain little; `propose` is printed for a term's first rounds only."""


class Tally(Struct):
    """Sum of the results of several seeds."""

    seeds: int = 0
    elections: int = 0
    faults: dict[str, int] = {}
    failed: dict[int, list[str]] = {}
    """Violations by seed."""

    def add(self, other: Tally) -> None:
        """Add the results of other seeds."""
        self.seeds += other.seeds
        self.elections += other.elections
        self.faults = dict(Counter(self.faults) + Counter(other.faults))
        self.failed = {**self.failed, **other.failed}


def command(
    seeds: Annotated[
        str | None, typer.Option(help="Number of seeds (1000; 60 with --whole) or range 5000..5999.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Run only this seed.")] = None,
    whole: Annotated[bool, typer.Option("--whole", help="Simulate complete agents and the world.")] = False,
    verbose: Annotated[
        bool, typer.Option("-v", "--verbose", help="With --seed: print the trace, one column per robot.")
    ] = False,
    jobs: Annotated[int, typer.Option(help="Number of parallel processes.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder for the traces of failed seeds.")] = Path("runs/fuzz"),
    as_json: Annotated[bool, typer.Option("--json", help="Print the totals as JSON.")] = False,
) -> int:
    """Search for fault schedules that violate an invariant of the lease protocol; exit with code 1 if one does."""
    player = play_whole if whole else play
    if seed is not None and seeds is not None:
        raise Refused(f"--seed {seed} with --seeds {seeds}: must be one of the two")
    if verbose and (seed is None or as_json):
        raise Refused("--verbose: must go with --seed, whose trace it tells, and without --json")
    if seed is not None:
        return _one(seed, verbose, player, as_json)
    return _hunt(parse_seeds(seeds or SEEDS[player]), jobs, out, as_json, player)


def parse_seeds(text: str) -> range:
    """Return the seeds of `1000` (0 to 999) or `5000..5999`. Raises Refused for other texts."""
    first, dots, last = text.partition("..")
    low, high = whole_number(first), whole_number(last)
    if low is None or (high is None and dots):
        raise Refused(f"--seeds {text}: must be a number (1000) or a range (5000..5999)")
    chosen = range(low) if high is None else range(low, high + 1)
    if not 0 < chosen.stop - chosen.start <= SEEDS_MAX:
        raise Refused(f"--seeds {text}: must name at least one seed, and at most {SEEDS_MAX}")
    return chosen


def _one(seed: int, verbose: bool, player: Player = play, as_json: bool = False) -> int:
    lines: list[str] = []
    played = player(draw(seed), columns(lines, draw(seed)) if verbose else None)
    if as_json:
        facts = {"seed": seed, "schedule": describe(played.schedule), "elections": played.elections}
        violations = [said(violation) for violation in played.violations]
        typer.echo(json.dumps({**facts, "faults": dict(played.counts), "violations": violations}))
        return 1 if violations else 0
    typer.echo(describe(played.schedule))
    for line in lines:
        typer.echo(line)
    for violation in played.violations:
        typer.echo(said(violation))
    typer.echo(f"seed {seed}: {len(played.violations)} violations, {played.elections} elections")
    return 1 if played.violations else 0


def _hunt(seeds: range, jobs: int, out: Path, as_json: bool, player: Player) -> int:
    if jobs < 1:
        raise Refused(f"--jobs {jobs}: must be 1 or more")
    began, tally = time.perf_counter(), Tally()
    told_at = began
    try:
        for part in _played(seeds, jobs, player):
            tally.add(part)
            if time.perf_counter() > told_at + TELL_EVERY_S:
                told_at = time.perf_counter()
                typer.echo(so_far(tally, len(seeds), told_at - began), err=True)
    except KeyboardInterrupt:
        return _interrupted(tally, seeds, time.perf_counter() - began, as_json)
    minutes = (time.perf_counter() - began) / 60.0
    missing = [kind for kind in KINDS if kind not in tally.faults] if len(seeds) >= KINDS_CLAIM_SEEDS else []
    for seed in sorted(tally.failed)[:FAILURES_SHOWN_MAX]:
        typer.echo(f"seed {seed}: {tally.failed[seed][0]}  reproduce: {again(seed, player)}", err=True)
        typer.echo(f"  shrunk trace: {_explain(seed, out, player)}", err=True)
    if missing:
        typer.echo(f"faults that never took effect: {', '.join(missing)}", err=True)
    if as_json:
        facts = {"seeds": tally.seeds, "elections": tally.elections, "faults": tally.faults}
        rate = {"per_minute": round(tally.seeds / minutes), "jobs": jobs}
        failed = {str(s): what for s, what in tally.failed.items()}
        typer.echo(json.dumps({**facts, **rate, "failed": failed, "missing": missing}))
    else:
        typer.echo(" ".join(f"{kind}={tally.faults.get(kind, 0)}" for kind in KINDS))
        rate_text = f"{tally.seeds / minutes:.0f} a minute with {jobs} jobs"
        typer.echo(f"{tally.seeds} schedules ({rate_text}), {tally.elections} elections, {len(tally.failed)} failed")
    return 1 if tally.failed or missing else 0


def _interrupted(tally: Tally, seeds: range, seconds: float, as_json: bool) -> int:
    """Print what a search that Ctrl-C ended has found; the failed seeds are not shrunk."""
    typer.echo(f"interrupted: {so_far(tally, len(seeds), seconds)}", err=as_json)
    if as_json:
        failed = {str(seed): what for seed, what in tally.failed.items()}
        facts = {"seeds": tally.seeds, "elections": tally.elections, "faults": tally.faults, "failed": failed}
        typer.echo(json.dumps({**facts, "interrupted": True}))
    return 130


def so_far(tally: Tally, of: int, seconds: float) -> str:
    """Return the progress of a long search as text; it is also the result of one that is interrupted."""
    rate = f"{60.0 * tally.seeds / seconds:.0f} a minute"
    faults = sum(tally.faults.values())
    failed = f"{len(tally.failed)} failed {sorted(tally.failed)[:FAILURES_SHOWN_MAX] or ''}".rstrip()
    return f"{tally.seeds} of {of} schedules ({rate}), {tally.elections} elections, {faults} faults, {failed}"


def _played(seeds: range, jobs: int, player: Player) -> Iterator[Tally]:
    chunk = CHUNKS[player]
    parts = [(seeds[i : i + chunk], player) for i in range(0, len(seeds), chunk)]
    if jobs == 1:
        yield from map(_play_part, parts)
        return
    with workers(min(jobs, os.cpu_count() or 1)) as pool:
        yield from pool.map(_play_part, parts)


def _play_part(part: tuple[range, Player]) -> Tally:
    seeds, player = part
    tally = Tally()
    for seed in seeds:
        played = player(draw(seed), None)
        failed = {seed: [said(v) for v in played.violations]} if played.violations else {}
        tally.add(Tally(1, played.elections, dict(played.counts), failed))
    return tally


def shrink(schedule: Schedule, name: str, player: Player = play) -> Schedule:
    """Return a schedule with fewer faults that still violates invariant `name`.

    Halves of the faults are left out first, then quarters, and so on down to single faults.
    """
    size = max(len(schedule.faults) // 2, 1)
    while True:
        index, smaller = 0, False
        while index < len(schedule.faults):
            tried = without(schedule, *range(index, index + size))
            if any(v.name == name for v in player(tried, None).violations):
                schedule, smaller = tried, True
            else:
                index += size
        if size == 1 and not smaller:
            return schedule
        size = max(size // 2, 1)


def again(seed: int, player: Player) -> str:
    """Return the command line that runs a seed again."""
    return f"lfa fuzz {'--whole ' if player is play_whole else ''}--seed {seed} -v"


def _explain(seed: int, out: Path, player: Player) -> Path:
    """Write the shrunk schedule of a failed seed and its trace; return the path."""
    small = shrink(draw(seed), player(draw(seed), None).violations[0].name, player)
    lines: list[str] = []
    played = player(small, columns(lines, small))
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{'whole-' if player is play_whole else ''}{seed}.txt"
    text = [describe(small), *lines, *(said(v) for v in played.violations)]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
    return path


def columns(lines: list[str], schedule: Schedule) -> Trace:
    """Return a trace that appends to `lines`: time [ms], then one column for the witness and one for each robot."""
    ids = range(schedule.robots + 1)
    lines.append("      ms  " + "".join(f"{'witness' if i == 0 else f'robot{i}':<{COLUMN}}" for i in ids).rstrip())

    def trace(at: float, who: int, what: str) -> None:
        if not what.startswith(SKIPPED) and not (what.startswith("propose") and " r" in what and " r0" not in what):
            lines.append(f"{at * 1000.0:8.1f}  {' ' * (COLUMN * who)}{what}")

    return trace


def describe(schedule: Schedule) -> str:
    """Return a schedule as text: the link conditions in one line, then one line for each fault."""
    radio = schedule.radio
    head = f"{schedule.robots} robots, witness {schedule.witness}, {schedule.profile}, delay <= {radio.prompt_s:g} s"
    lines = [f"{head}, loss {radio.loss}, duplicate {radio.duplication}, tail {radio.tail}"]
    for fault in schedule.faults:
        targets = ", ".join("leader" if t < 0 else str(t) for t in fault.targets)
        lines.append(f"{fault.at * 1000.0:8.1f}  {fault.kind} {targets} ({fault.duration_s:.3f} s, {fault.value:.2f})")
    return "\n".join(lines)


def said(violation: Violation) -> str:
    """Return a violation as one line of text."""
    return f"{violation.name} at {violation.at:.4f} s: {violation.text}"
