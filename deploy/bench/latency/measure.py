"""Rows of `lfa bench latency`, from the journals of teams that drive, and from kills of their leader.

What the control period itself costs is left out: a pose waits for the next control step of its reader, on average half
a period. The wait is a row of its own: a control step on the arrival of the pose would save it.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from itertools import chain as joined
from math import nan

from lfa.deploy.bench.failover import KINDS, FailoverBench, quantile
from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.bench.harness.team import Team, endless
from lfa.deploy.bench.latency.chain_times import ages_s, hops_of
from lfa.deploy.bench.latency.udp import one_way_ms
from lfa.deploy.recording.run_folder import JOURNALS
from lfa.protocol import clock
from lfa.protocol.errors import Refused

SIZES = (4, 10)
MINUTES = 0.25
KILLS = 30
UDP_TIMES = 5.0
"""Largest latency of a hop, in one-way times of raw UDP of the same run."""
KILL_MS_MAX = 10.0
KILL = "kill of the leader"
AGREED_S_MAX = 60.0


def run(as_json: bool, rows: str = "*", minutes: float = MINUTES, kills: int = KILLS) -> int:
    """Print the rows; return 0 if all hold, else 1. Each team is watched for `minutes`; the leader dies `kills` times.

    Raises Refused if no row has such a name.
    """
    names = [*(_name(size) for size in SIZES), KILL]
    chosen = [name for name in names if fnmatchcase(name, rows.partition("/")[0])]
    if not chosen:
        raise Refused(f"--rows {rows!r}: no row has such a name; they begin with {', '.join(names)}")
    return show(_rows(chosen, minutes, kills), as_json)


def _rows(chosen: Sequence[str], minutes: float, kills: int) -> Iterator[list[BenchRow]]:
    for size in SIZES:
        if _name(size) in chosen:
            yield _chain_rows(size, 60.0 * minutes)
    if KILL in chosen:
        with FailoverBench(SIZES[0]) as bench:
            times = [bench.round(KINDS[0]).command_ms for _ in range(kills)]
        yield [
            row(KILL, Quantity("new leader's first command, p50", "ms", KILL_MS_MAX), quantile(times, 0.5)),
            row(KILL, Quantity("new leader's first command, p99", "ms"), quantile(times, 0.99)),
        ]


def _name(size: int) -> str:
    return f"chain of {size}"


def _chain_rows(size: int, watched_s: float) -> list[BenchRow]:
    """Return the rows of a team that drives for `watched_s` [s], with raw UDP measured beside it."""
    name = _name(size)
    with Team(endless(size)) as team:
        order = team.await_chain(size, AGREED_S_MAX)
        began = clock.now()
        udp = one_way_ms()
        team.wait_until(lambda: clock.now() >= began + watched_s, "the clock stands", watched_s + AGREED_S_MAX)
        ended = clock.now()
        lags = [status.message.counters.get("loop_lag_ms", 0.0) for status in team.heard.state.status.values()]
        team.judged()
        hops = [
            [hop for hop in one if began <= hop.step_at <= ended]
            for one in hops_of(team.folder / "run" / JOURNALS, order)
        ]
    udp_ms, every = statistics.median(udp), list(joined.from_iterable(hops))
    latency, wait = [1000.0 * hop.latency_s for hop in every], [1000.0 * hop.wait_s for hop in every]
    ages = [1000.0 * age for age in ages_s(hops)] if all(hops) else []
    return [
        row(name, Quantity("raw UDP one way, p50", "ms"), udp_ms),
        row(name, Quantity("raw UDP one way, p99", "ms"), quantile(udp, 0.99)),
        row(name, Quantity("pose to accepted command, p50", "ms", UDP_TIMES * udp_ms), _quantile(latency, 0.5)),
        row(name, Quantity("pose to accepted command, p99", "ms"), _quantile(latency, 0.99)),
        row(name, Quantity("loop lag, the largest", "ms"), max(lags, default=nan)),
        row(name, Quantity("a pose waits for the control step, p50", "ms"), _quantile(wait, 0.5)),
        row(name, Quantity("age of the leader's pose at the tail, p50", "ms"), _quantile(ages, 0.5)),
        row(name, Quantity("age of the leader's pose at the tail, p99", "ms"), _quantile(ages, 0.99)),
    ]


def _quantile(values: Sequence[float], share: float) -> float:
    return quantile(values, share) if values else nan
