"""Figures of `lfa bench operate`, all in virtual time."""

from __future__ import annotations

from collections.abc import Iterator
from fnmatch import fnmatchcase
from math import hypot
from random import Random
from statistics import median

from msgspec import structs

from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.bench.operate.commanded import CommandedTeam
from lfa.deploy.client.mission_changes import along
from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.deploy.fuzz.network import FAIR
from lfa.deploy.fuzz.schedules import ScheduledFault
from lfa.deploy.fuzz.stops import StopQuestions, StopTraffic

SEEDS = 50
DRIVING_S = 4.0
"""Time [s] by which a team drives at cruising speed."""
LATE_MS_MAX = 60.0
"""Longest time [ms] from the word to the last wheel at rest, beyond that of braking."""
ROBOTS, LOSSES, ANSWERED_S_MAX = 12, (0.0, 0.2, 0.6), 1.0
KILLED_WITHIN_S = 0.1
AHEAD_M, ASIDE_M, NEAR_M = 4.0, 1.5, 0.3
TRUTH_S = 0.02
"""Time [s] between two true states: a wheel may turn for so long after it was last seen to."""
THERE_S = 25.0
"""Time [s] that a team of three has for the way to the goal, with the change of its leader."""


def run(as_json: bool, rows: str = "*", seeds: int = SEEDS) -> int:
    """Print the rows; return 0 if all hold, else 1."""
    return show(_rows(rows, seeds), as_json)


def _rows(wanted: str, seeds: int) -> Iterator[list[BenchRow]]:
    if fnmatchcase("stop/chain of 4", wanted):
        late_ms = [1000.0 * _late_s(seed) for seed in range(seeds)]
        word = "word to last wheel at rest, over v/a"
        yield [
            row("stop/chain of 4", Quantity(f"{word}, p50", "ms", LATE_MS_MAX), median(late_ms)),
            row("stop/chain of 4", Quantity(f"{word}, max", "ms"), max(late_ms)),
        ]
    for loss in LOSSES:
        name = f"stop/{ROBOTS} robots, {100.0 * loss:.0f} % loss"
        if fnmatchcase(name, wanted):
            results = [_result(loss, seed) for seed in range(seeds)]
            yield [
                row(name, Quantity("all stopped or named, max", "s", ANSWERED_S_MAX), max(at for at, _ in results)),
                row(name, Quantity("all stopped, p50", "s"), median(at for at, _ in results)),
                row(name, Quantity("named as not stopped", "robots"), float(sum(named for _, named in results))),
            ]
    if fnmatchcase("go/leader killed", wanted):
        there = sum(map(_goes_there, range(seeds)))
        reached = Quantity("the next leader reaches the goal", "runs", float(seeds), "at least")
        yield [row("go/leader killed", reached, float(there))]


def _late_s(seed: int) -> float:
    """Return the time [s] from the word to the last wheel at rest, beyond braking from the team's highest speed."""
    scene = CommandedTeam(4, seed)
    scene.team.run(DRIVING_S + Random(seed).uniform(0.0, 0.1))
    said_at, speed_mps = scene.team.now, max(abs(robot.linear_x) for robot in scene.robots.values())
    scene.stop()
    scene.team.run(scene.team.now + 1.0)
    return scene.moved_at + TRUTH_S - said_at - speed_mps / scene.team.mission.limits.a_max_mps2


def _result(loss: float, seed: int) -> tuple[float, int]:
    """Return how long [s] a stop took whose messages are lost in `loss` of all cases, and how many robots it named."""
    team = LeaseSimulation(ROBOTS, seed=seed, radio=structs.replace(FAIR, loss=loss)).start_all()
    traffic = StopTraffic(team, team.mission.robots, seed)
    StopQuestions(team, team.mission.robots, traffic.links)
    traffic.begin((ScheduledFault(1.0, "stop", (0,)),))
    team.run(3.0)
    ((said_at, ended_at, outcome),) = traffic.outcomes
    return ended_at - said_at, len(outcome.silent)


def _goes_there(seed: int) -> bool:
    """Return whether a team whose leader is killed right after `lfa go` comes to the goal under the next."""
    scene, chance = CommandedTeam(3, seed), Random(f"go-{seed}")
    scene.team.run(DRIVING_S + chance.uniform(0.0, 0.1))
    first = scene.robots[1]
    goal = (first.x + AHEAD_M, first.y + chance.choice((-ASIDE_M, ASIDE_M)))
    scene.order_and_kill(along((goal,), ()), chance.uniform(0.0, KILLED_WITHIN_S))
    scene.team.run(scene.team.now + THERE_S)
    leaders = scene.team.leaders()
    return leaders == [2] and hypot(scene.robots[2].x - goal[0], scene.robots[2].y - goal[1]) < NEAR_M
