"""`lfa bench agent`: an agent's share of a core and memory while a team of four drives, and the time to its first pose.

In the same run a bare process (`harness/bare_process.py`) has the same traffic as one agent and computes nothing.
"""

from __future__ import annotations

import os
import signal
import statistics
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec
from msgspec.structs import replace

from lfa.agents.agent import Agent
from lfa.deploy.bench.harness import bare_process
from lfa.deploy.bench.harness.child_process import cpu_s, pause, started
from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.bench.harness.team import Team
from lfa.deploy.client.session import listen
from lfa.deploy.process import identity
from lfa.protocol import clock
from lfa.protocol.names import robot_name
from lfa.protocol.topics import HARDWARE, key
from lfa.world.description.load import load

SCENARIO = "straight"
LIKE = 3
"""Id of the robot whose traffic the bare process copies: a follower with a successor."""
SETTLE_S = 5.0
WATCHED_S = 30.0
MIB = 2**20


def run(as_json: bool) -> int:
    """Print the rows; return 0 if all hold, else 1."""
    return show(_rows(), as_json)


def _rows() -> Iterator[list[BenchRow]]:
    with Team(load(SCENARIO)) as team:
        robots = team.scenario.mission.robots
        team.await_chain(len(robots))
        pause(team, SETTLE_S)
        task = _task(team)
        elsewhere = replace(team.fleet, name=_elsewhere(team))
        words = [
            sys.executable,
            "-P",
            "-m",
            "lfa.deploy.bench.harness.bare_process",
            msgspec.json.encode(task).decode(),
        ]
        with listen(elsewhere, frozenset({f"{robot_name(LIKE)}/**"})), started(words) as process:
            pause(team, SETTLE_S)
            agents = [team.process_of(robot_name(robot)) for robot in robots]
            yield _costs(*_shares(team, agents, process))
            largest = max(_resident_mib(agent) for agent in agents)
            yield [row("agent", Quantity("resident, the largest", "MiB", 35.0), largest)]
        yield [row("agent", Quantity("first pose after its start", "s", 1.0), _first_pose_s(team, robots[-1]))]


def _shares(
    team: Team, agents: Sequence[identity.Identity], process: subprocess.Popen[bytes]
) -> tuple[list[float], float]:
    """Return the shares of a core [%] of each agent and of the bare process, over the same time."""
    since, before, bare_before = clock.now(), [identity.cpu_s(agent) for agent in agents], cpu_s(process)
    pause(team, WATCHED_S)
    percent = 100.0 / (clock.now() - since)
    used = [identity.cpu_s(agent) - was for agent, was in zip(agents, before, strict=True)]
    return [percent * used_s for used_s in used], percent * (cpu_s(process) - bare_before)


def _costs(shares: Sequence[float], bare_share: float) -> list[BenchRow]:
    """Return the rows of these shares [%]."""
    mean = statistics.mean(shares)
    return [
        row("agent", Quantity("share of a core, mean", "%", 5.0), mean),
        row("agent", Quantity("share of a core, the largest", "%", 5.0), max(shares)),
        row("bare process", Quantity("share of a core", "%"), bare_share),
        row("agent", Quantity("times a bare process", "1"), mean / bare_share),
    ]


def _task(team: Team) -> bare_process.BareTask:
    """Return a task with the subscriptions and measured publications of robot `LIKE`, on keys of an unused fleet."""
    fleet, name, ahead = team.fleet.name, robot_name(LIKE), robot_name(LIKE - 1)
    agent = Agent(LIKE, 1, fleet, 1, team.scenario.mission)
    agent.tick(0.0)
    count: Counter[str] = Counter()
    size: Counter[str] = Counter()
    with listen(team.fleet, frozenset({f"{name}/*", f"{name}/lease/*"}), every=True) as subscriber:
        subscriber.take()
        since = clock.now()
        pause(team, SETTLE_S)
        for arrival, _ in subscriber.take():
            if isinstance(arrival.payload, bytes) and _of_agent(arrival.key):
                count[arrival.key] += 1
                size[arrival.key] += len(arrival.payload)
        passed_s = clock.now() - since
    says = (
        bare_process.Saying(
            where.replace(fleet, _elsewhere(team), 1), size[where] // count[where], count[where] / passed_s
        )
        for where in sorted(count)
    )
    return bare_process.BareTask(
        team.fleet.endpoint, (*sorted(agent.interests), key(fleet, ahead, "pose")), tuple(says)
    )


def _of_agent(where: str) -> bool:
    """Return True for a key that the agent publishes, False for one of its hardware."""
    return where.split("/")[3] not in HARDWARE


def _elsewhere(team: Team) -> str:
    return f"{team.fleet.name}-bare"


def _first_pose_s(team: Team, robot: int) -> float:
    """Kill and restart an agent; return the time [s] from its start to its first pose."""
    with listen(team.fleet, frozenset({f"{robot_name(robot)}/pose"})) as subscriber:
        team.signal(robot, signal.SIGKILL)
        at = clock.now()
        team.restart(robot)
        stamps: list[float] = []

        def spoke() -> bool:
            stamps.extend(message.header.stamp for _, message in subscriber.take() if message.header.stamp >= at)
            return bool(stamps)

        team.wait_until(spoke, f"no pose of {robot_name(robot)}")
    return stamps[0] - at


def _resident_mib(agent: identity.Identity) -> float:
    pages = int(Path(f"/proc/{agent.pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / MIB
