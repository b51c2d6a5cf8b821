"""Teams of `lfa bench agents`: each is started, agrees on one chain, and is watched while it drives.

Teams of 50 Hz run the scenario as it is, the others at the rates at which `lfa run` lets a machine carry more robots.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from functools import partial
from math import nan

from msgspec import Struct

from lfa.deploy.bench.agents.footprint import Footprint, footprint
from lfa.deploy.bench.harness.rows import Case, Quantity, measured, select, show
from lfa.deploy.bench.harness.team import SETTLED_S, Broken, Team
from lfa.deploy.process import identity
from lfa.deploy.process.process_group import ROUTER_NAME
from lfa.deploy.run.machine_size import slower
from lfa.protocol import clock
from lfa.protocol.names import robot_name
from lfa.protocol.topics import WORLD_NAME
from lfa.world.description.load import Scenario, load

SCENARIO = "straight"
SIZES, SIZES_FULL = (4, 20, 50), (4, 20, 50, 100)
USUAL_MAX = 4
"""Largest team that is also measured at the usual rates."""
AGREED_S_MAX = 120.0
WATCHED_S = 15.0
LOOK_S = 0.5
SHARE_BARS = {50.0: 3.5, 20.0: 1.3}
"""Largest share of a core [%] of an agent, by its control rate [Hz]."""


class DrivingTeam(Struct):
    """What was seen of a team while it drove."""

    lags_ms: list[float]
    """Largest lateness [ms] of a robot's loop in a second, for each robot and second."""
    leaders: set[int]
    factor: float
    """Time that passed in the world, as a share of real time."""


def run(as_json: bool, rows: str = "*", full: bool = False) -> int:
    """Print the rows; return 0 if all hold, else 1. `full`: 100 robots, too."""
    return show(measured(select(cases(SIZES_FULL if full else SIZES), rows), 1, rows), as_json)


def cases(sizes: Sequence[int]) -> list[Case]:
    """Return the teams to measure, those at usual rates first."""
    usual = [load(SCENARIO, (), robots) for robots in sizes if robots <= USUAL_MAX]
    return [_case(scenario) for scenario in (*usual, *(slower(load(SCENARIO, (), robots)) for robots in sizes))]


def _case(scenario: Scenario) -> Case:
    mission = scenario.mission
    hz = mission.control_hz
    quantities = (
        Quantity("share of a core, mean", "%", SHARE_BARS[hz]),
        Quantity("share, with world and router", "%"),
        Quantity("unique memory, mean", "MiB", 15.0),
        Quantity("resident, the largest", "MiB", 35.0),
        Quantity("threads, the most", "1"),
        Quantity("all have sent a pose after", "s"),
        Quantity("one chain agreed after", "s"),
        Quantity("loop lag, p99", "ms", 1000.0 * mission.control_period_s),
        Quantity("leaders", "1", 1.0),
        Quantity("real-time factor", "1", 0.98, "at least"),
    )
    return Case(f"{len(mission.robots)} robots at {hz:g} Hz", quantities, partial(_measure, scenario))


def _measure(scenario: Scenario) -> list[float]:
    """Return the values of a team's quantities; not numbers where it never agreed on a chain."""
    robots, began = scenario.mission.robots, clock.now()
    with Team(scenario) as team:
        try:
            team.wait_until(lambda: set(robots) <= set(team.heard.state.poses), "no poses", AGREED_S_MAX)
            poses_s = clock.now() - began
            team.await_chain(len(robots), AGREED_S_MAX)
        except Broken:
            return [nan] * len(_case(scenario).quantities)
        agreed_s = clock.now() - began - SETTLED_S
        agents = [team.process_of(robot_name(robot)) for robot in robots]
        common = [team.process_of(name) for name in (WORLD_NAME, ROUTER_NAME)]
        at, own_s, common_s = clock.now(), _cpu_s(agents), _cpu_s(common)
        watched = _watch(team)
        percent = 100.0 / (clock.now() - at) / len(robots)
        own_s, common_s = _cpu_s(agents) - own_s, _cpu_s(common) - common_s
        prints = [footprint(agent.pid) for agent in agents]
    shares = [percent * own_s, percent * (own_s + common_s)]
    return [*shares, *_memory(prints), poses_s, agreed_s, _p99(watched.lags_ms), len(watched.leaders), watched.factor]


def _watch(team: Team) -> DrivingTeam:
    """Listen to a team for `WATCHED_S`."""
    state, robots = team.heard.state, team.scenario.mission.robots
    heard: dict[tuple[str, int], float] = {}
    watched = DrivingTeam([], set(), 0.0)
    began = now = clock.now()
    world_s = _world_s(team)
    while now < began + WATCHED_S:
        team.listen()
        watched.leaders |= {robot for robot in robots if state.roles.get(robot) == "leader"}
        for name, status in state.status.items():
            heard[name, status.message.header.seq] = status.message.counters.get("loop_lag_ms", 0.0)
        clock.sleep(LOOK_S)
        now = clock.now()
    team.listen()
    watched.lags_ms = list(heard.values())
    watched.factor = (_world_s(team) - world_s) / (clock.now() - began)
    return watched


def _world_s(team: Team) -> float:
    truth = team.heard.state.truth
    return 0.0 if truth is None else truth.time_s


def _cpu_s(processes: Sequence[identity.Identity]) -> float:
    return sum(identity.cpu_s(process) for process in processes)


def _memory(prints: Sequence[Footprint]) -> tuple[float, float, float]:
    return (
        statistics.mean(one.unique_mib for one in prints),
        max(one.resident_mib for one in prints),
        float(max(one.threads for one in prints)),
    )


def _p99(values: Sequence[float]) -> float:
    """Return the 99th percentile; not a number without values."""
    return sorted(values)[int(0.99 * len(values))] if values else nan
