"""`lfa bench router`: whose traffic each process carries, what a load says, and what a federation's routers pass on."""

from __future__ import annotations

from collections import Counter

import pytest

from lfa.deploy.bench.router import measure
from lfa.deploy.bench.router.federation import Federation, RouterTraffic, count, predicted, simulated
from lfa.deploy.bench.router.measure import RouterLoad
from lfa.deploy.bench.router.traffic import TrafficCount

PAIRS = Federation(robots=4, machines=2)
POSES = frozenset({"lfa/sim/robot1/pose"})
ROWS = frozenset({"lfa/sim/*/table"})


def passed_on(said: dict[str, int], interests: dict[str, frozenset[str]]) -> list[tuple[int, int]]:
    """Return of each machine of `PAIRS` what its router passes on to its processes, and to the other router."""
    routers = [RouterTraffic(Counter(), Counter()) for _ in range(PAIRS.machines)]
    count(PAIRS, said, interests, routers)
    return [(one.to_processes.total(), one.to_routers.total()) for one in routers]


def test_each_robot_is_published_by_one_process_and_heard_by_another() -> None:
    tasks = measure._tasks("unixsock-stream/nowhere", 10, 4, 20.0)
    assert sorted(robot for task in tasks for robot in task.says) == list(range(1, 11))
    assert sorted(robot for task in tasks for robot in task.hears) == list(range(1, 11))
    assert all(not set(task.says) & set(task.hears) for task in tasks)


def test_a_load_is_what_all_processes_received_while_the_longest_published() -> None:
    load = RouterLoad((TrafficCount(40, 30, 10.0), TrafficCount(40, 20, 8.0)), 0.001)
    assert (load.received, load.lasted_s) == (50, 10.0)
    assert measure._each_us(load) == 20.0


def test_a_message_crosses_to_another_router_once_however_many_processes_follow_it_there() -> None:
    followers = {"robot1": frozenset[str](), "robot2": POSES, "robot3": POSES, "robot4": POSES}
    assert passed_on({"lfa/sim/robot1/pose": 10}, followers) == [(10, 10), (20, 0)]


def test_what_nobody_follows_is_passed_on_by_no_router() -> None:
    assert passed_on({"lfa/sim/robot1/tracking": 10}, {"robot1": POSES, "robot2": POSES}) == [(0, 0), (0, 0)]


def test_a_row_of_the_table_is_not_passed_back_to_its_robot() -> None:
    assert passed_on({"lfa/sim/robot3/table": 10}, dict.fromkeys(("robot3", "robot4"), ROWS)) == [(0, 0), (10, 0)]


def test_a_command_stays_on_the_machine_of_its_robot_whose_driver_the_world_plays() -> None:
    followers = {"world": frozenset({"lfa/sim/robot4/cmd_vel", "lfa/sim/*/lease/gateway4"})}
    said = {"lfa/sim/robot4/cmd_vel": 10, "lfa/sim/robot1/lease/gateway4": 1}
    assert passed_on(said, followers) == [(0, 1), (11, 0)]


@pytest.mark.parametrize(
    "federation",
    [
        Federation(40, 4),
        pytest.param(Federation(100, 4), marks=pytest.mark.campaign),
        pytest.param(Federation(200, 10), marks=pytest.mark.campaign),
    ],
)
def test_the_formula_of_a_federation_says_within_a_tenth_what_its_routers_pass_on(federation: Federation) -> None:
    routers, duration_s = simulated(federation)
    head_hz, other_hz = predicted(federation)
    assert [one.passed_on / duration_s for one in routers] == pytest.approx(
        [head_hz, *[other_hz] * (federation.machines - 1)], rel=0.1
    )
