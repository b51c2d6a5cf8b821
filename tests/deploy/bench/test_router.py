"""`lfa bench router`: whose traffic each process carries, and what a load says."""

from __future__ import annotations

from lfa.deploy.bench.router import measure
from lfa.deploy.bench.router.measure import RouterLoad
from lfa.deploy.bench.router.traffic import TrafficCount


def test_each_robot_is_published_by_one_process_and_heard_by_another() -> None:
    tasks = measure._tasks("unixsock-stream/nowhere", 10, 4, 20.0)
    assert sorted(robot for task in tasks for robot in task.says) == list(range(1, 11))
    assert sorted(robot for task in tasks for robot in task.hears) == list(range(1, 11))
    assert all(not set(task.says) & set(task.hears) for task in tasks)


def test_a_load_is_what_all_processes_received_while_the_longest_published() -> None:
    load = RouterLoad((TrafficCount(40, 30, 10.0), TrafficCount(40, 20, 8.0)), 0.001)
    assert (load.received, load.lasted_s) == (50, 10.0)
    assert measure._each_us(load) == 20.0
