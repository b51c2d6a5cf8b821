"""`lfa bench restarts`: 100 restarts of a robot with empty memory at random times in ten minutes.

The robot must always return to the chain, and the journals of the whole run must violate no invariant.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from random import Random

from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.bench.harness.team import Broken, Team, endless
from lfa.protocol import clock

ROBOTS = 4
RESTARTS = 100
EVERY_S = 6.0
REJOIN_S = 30.0
"""Maximum time [s] to wait for the whole chain; t_remove plus one second should suffice."""


def run(as_json: bool, kills: int = RESTARTS) -> int:
    """Print the rows; return 0 if all hold, else 1."""
    return show(_rows(kills), as_json)


def _rows(kills: int) -> Iterator[list[BenchRow]]:
    chance = Random("restarts")
    rejoined, slowest_s = 0, 0.0
    with Team(endless(ROBOTS)) as team:
        team.await_chain(ROBOTS)
        for _ in range(kills):
            until = clock.now() + EVERY_S
            _look_on(team, clock.now() + 2.0 * chance.random())
            victim = chance.choice(team.scenario.mission.robots)
            team.signal(victim, signal.SIGKILL)
            _look_on(team, clock.now() + chance.choice((0.0, 0.02, 0.2, 1.0)))
            team.restart(victim)
            began = clock.now()
            try:
                team.wait_until(lambda: len(team.chain()) == ROBOTS, f"robot {victim} is not back", REJOIN_S)
            except Broken as broken:
                print(f"{broken}: {team.heard.describe(clock.now())}", file=sys.stderr, flush=True)
                continue
            rejoined += 1
            slowest_s = max(slowest_s, clock.now() - began)
            _look_on(team, until)
        verdict = team.judged()
    for broken_one in verdict.broken:
        print(f"{broken_one.name} at {broken_one.at:.3f} s: {broken_one.text}", file=sys.stderr, flush=True)
    yield [
        row("restarts", Quantity("rejoined", "times", float(kills), "at least"), float(rejoined)),
        row("restarts", Quantity("slowest start to whole chain", "s"), slowest_s),
        row("restarts", Quantity("violations", "times", 0.0), float(len(verdict.broken))),
    ]


def _look_on(team: Team, until: float) -> None:
    team.wait_until(lambda: clock.now() >= until, "the clock stands", 2.0 * EVERY_S)
