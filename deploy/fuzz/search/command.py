"""`lfa fuzz`: search for fault schedules that violate an invariant; shrink, trace and reproduce them.

A seed determines the schedule and the run: the same seed on the same commit fails in the same way.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from lfa.deploy.analysis.causes.broken_rules import lines as chain_lines
from lfa.deploy.campaign.shard import WHOLE, Shard, parse_shard
from lfa.deploy.fuzz.search import systematic
from lfa.deploy.fuzz.search.searches import (
    Kind,
    Search,
    Tally,
    again,
    explain,
    play_part,
    tally_of_seed,
    write_explanation,
)
from lfa.deploy.fuzz.search.shares import do_fuzz
from lfa.deploy.fuzz.search.trace_text import columns, describe, said
from lfa.deploy.process.worker_pool import workers
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused
from lfa.protocol.names import whole_number

SEEDS, SEEDS_WHOLE = "1000", "60"
"""Default of `--seeds`."""
KINDS_CLAIM_SEEDS = 60
"""Minimum number of seeds from which on every kind of fault must have taken effect."""
SEEDS_MAX = 100_000_000
FAILURES_SHOWN_MAX = 5
TELL_EVERY_S = 10.0
TRACES = Path("runs/fuzz")
DRAWN = Search()
OPTIONS: dict[str, Kind] = {
    "--systematic": "systematic",
    "--guided": "guided",
    "--lagging": "lagging",
    "--stops": "stops",
}


def command(
    seeds: Annotated[
        str | None, typer.Option(help="Number of seeds (1000; 60 with --whole) or range 5000..5999.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Run only this seed.")] = None,
    whole: Annotated[bool, typer.Option("--whole", help="Simulate complete agents and the world.")] = False,
    is_systematic: Annotated[
        bool, typer.Option("--systematic", help="Few faults and delays, in order; a seed is a place in that order.")
    ] = False,
    is_guided: Annotated[
        bool, typer.Option("--guided", help="Change schedules that made a lease do something new.")
    ] = False,
    is_lagging: Annotated[
        bool, typer.Option("--lagging", help="Teams with the profile auto, whose processes lag.")
    ] = False,
    is_stops: Annotated[
        bool, typer.Option("--stops", help="The fleet stop alone: gateways, agents and operators, without leases.")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("-v", "--verbose", help="With --seed: print the trace, one column per robot.")
    ] = False,
    jobs: Annotated[int, typer.Option(help="Number of parallel processes.")] = 1,
    out: Annotated[
        Path | None, typer.Option(help="Keep the results here: done again are only those that are missing.")
    ] = None,
    shard: Annotated[str | None, typer.Option(help="With --out: do only this share of the seeds, 3/16.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the totals as JSON.")] = False,
) -> int:
    """Search for fault schedules that violate an invariant of the lease protocol; exit with code 1 if one does."""
    chosen_kinds = {"--systematic": is_systematic, "--guided": is_guided, "--lagging": is_lagging, "--stops": is_stops}
    named = [option for option, is_chosen in chosen_kinds.items() if is_chosen]
    if len(named) > 1:
        raise Refused(f"{named[0]} with {named[1]}: must be one of the two")
    if whole and (is_systematic or is_guided or is_stops):
        raise Refused(f"--whole: must go without {named[0]}, which plays no whole robots")
    kind: Kind = next((kind for option, kind in OPTIONS.items() if option in named), "drawn")
    search = Search(kind, whole)
    if seed is not None and seeds is not None:
        raise Refused(f"--seed {seed} with --seeds {seeds}: must be one of the two")
    if verbose and (seed is None or as_json):
        raise Refused("--verbose: must go with --seed, whose trace it tells, and without --json")
    if seed is not None:
        return _one(seed, verbose, search, as_json)
    chosen = parse_seeds(seeds or (SEEDS_WHOLE if whole else SEEDS))
    if jobs < 1:
        raise Refused(f"--jobs {jobs}: must be 1 or more")
    if out is not None:
        return _kept(chosen, jobs, out, WHOLE if shard is None else parse_shard(shard), as_json, search)
    if shard is not None:
        raise Refused(f"--shard {shard}: must go with --out, the folder of the results")
    return _hunt(chosen, jobs, as_json, search)


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


def _one(seed: int, verbose: bool, search: Search = DRAWN, as_json: bool = False) -> int:
    lines: list[str] = []
    schedule = search.schedule(seed)
    played = search.player(schedule, columns(lines, schedule) if verbose else None)
    if as_json:
        facts = {"seed": seed, "schedule": describe(played.schedule), "elections": played.elections}
        violations = [said(violation) for violation in played.violations]
        print_visible(json.dumps({**facts, "faults": dict(played.counts), "violations": violations}))
        return 1 if violations else 0
    print_visible(describe(played.schedule))
    for line in lines:
        print_visible(line)
    for violation in played.violations:
        print_visible(said(violation))
    for line in [] if played.broken is None else chain_lines(played.broken):
        print_visible(line)
    print_visible(f"seed {seed}: {len(played.violations)} violations, {played.elections} elections")
    return 1 if played.violations else 0


def _kept(seeds: range, jobs: int, out: Path, shard: Shard, as_json: bool, search: Search) -> int:
    """Do a share of a search whose results are kept in `out`; `lfa campaign merge` joins several."""
    began = time.perf_counter()
    kept, tally = do_fuzz(seeds, search, out, shard, jobs)
    played = seeds if len(kept.names_there()) == len(kept.campaign.names) else seeds[: tally.seeds]
    return _tell(tally, played, time.perf_counter() - began, jobs, as_json, search)


def _hunt(seeds: range, jobs: int, as_json: bool, search: Search) -> int:
    began, tally = time.perf_counter(), Tally()
    shown_at = began
    try:
        for part in _played(seeds, jobs, search):
            tally.add(part)
            if time.perf_counter() > shown_at + TELL_EVERY_S:
                shown_at = time.perf_counter()
                print_visible(so_far(tally, len(seeds), shown_at - began), file=sys.stderr)
    except KeyboardInterrupt:
        return _interrupted(tally, seeds, time.perf_counter() - began, as_json)
    seconds = time.perf_counter() - began
    for seed in sorted(tally.failed)[:FAILURES_SHOWN_MAX]:
        print_visible(f"seed {seed}: {tally.failed[seed][0]}  reproduce: {again(seed, search)}", file=sys.stderr)
        path = write_explanation(seed, explain(seed, search), TRACES, search)
        print_visible(f"  shrunk trace: {path}", file=sys.stderr)
    return _tell(tally, seeds, seconds, jobs, as_json, search)


def _tell(tally: Tally, seeds: range, seconds: float, jobs: int, as_json: bool, search: Search) -> int:
    """Print the result of a search over `seeds` and return its exit code."""
    claimed = len(seeds) >= KINDS_CLAIM_SEEDS and search.kind in ("drawn", "stops")
    missing = [kind for kind in search.kinds if kind not in tally.faults] if claimed else []
    covered = systematic.covered(seeds) if search.kind == "systematic" else []
    if missing:
        print_visible(f"faults that never took effect: {', '.join(missing)}", file=sys.stderr)
    rate = round(60.0 * tally.seeds / seconds)
    if as_json:
        facts = {"seeds": tally.seeds, "elections": tally.elections, "faults": tally.faults}
        failed = {str(s): what for s, what in tally.failed.items()}
        print_visible(
            json.dumps(
                {**facts, "per_minute": rate, "jobs": jobs, "failed": failed, "missing": missing, "covered": covered}
            )
        )
    else:
        print_visible(" ".join(f"{kind}={tally.faults.get(kind, 0)}" for kind in search.kinds))
        for line in covered:
            print_visible(line)
        rate_text = f"{rate} a minute with {jobs} jobs"
        print_visible(f"{tally.seeds} schedules ({rate_text}), {tally.elections} elections, {len(tally.failed)} failed")
    return 1 if tally.failed or missing else 0


def _interrupted(tally: Tally, seeds: range, seconds: float, as_json: bool) -> int:
    """Print what a search that Ctrl-C ended has found; the failed seeds are not shrunk."""
    print_visible(f"interrupted: {so_far(tally, len(seeds), seconds)}", file=sys.stderr if as_json else None)
    if as_json:
        failed = {str(seed): what for seed, what in tally.failed.items()}
        facts = {"seeds": tally.seeds, "elections": tally.elections, "faults": tally.faults, "failed": failed}
        print_visible(json.dumps({**facts, "interrupted": True}))
    return 130


def so_far(tally: Tally, of: int, seconds: float) -> str:
    """Return the progress of a long search as text; it is also the result of one that is interrupted."""
    rate = f"{60.0 * tally.seeds / seconds:.0f} a minute"
    faults = sum(tally.faults.values())
    failed = f"{len(tally.failed)} failed {sorted(tally.failed)[:FAILURES_SHOWN_MAX] or ''}".rstrip()
    return f"{tally.seeds} of {of} schedules ({rate}), {tally.elections} elections, {faults} faults, {failed}"


def _played(seeds: range, jobs: int, search: Search) -> Iterator[Tally]:
    chunk = search.chunk
    parts = [(seeds[i : i + chunk], search) for i in range(0, len(seeds), chunk)]
    if jobs == 1:  # seed by seed, so that Ctrl-C loses none
        yield from (tally_of_seed(seed, played) for seed, played in search.played(seeds))
        return
    with workers(min(jobs, os.cpu_count() or 1)) as pool:
        yield from pool.map(play_part, parts)
