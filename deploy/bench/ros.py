"""Bench `ros`: what the bridge to ROS 2 costs, how late its topics come, and how a ROS robot does as a member.

One process listens to the fleet and to the bridge at once, so that the machine's load delays both alike; a sample is
recognised by its pose.
"""

from __future__ import annotations

import re
import statistics
import subprocess
from collections.abc import Iterator
from fnmatch import fnmatchcase
from itertools import chain
from math import isfinite
from pathlib import Path
from socket import socket

from lfa.deploy.bench.harness.child_process import cpu_s, pause, started
from lfa.deploy.bench.harness.ros_member import member_rows
from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.bench.harness.team import Team, endless
from lfa.deploy.bench.look import LFA
from lfa.deploy.client.session import Subscriber, listen
from lfa.deploy.ros.session import RosSpace, RosSubscription
from lfa.deploy.ros.topics import fleet_topics, robot_topics
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.robot import Sensors
from lfa.protocol.messages.team import Status
from lfa.protocol.transport.bus import Wake
from lfa.protocol.transport.zenoh_ros import RosSession, ros_session

ROBOTS = 4
SETTLE_S, WATCHED_S, STEP_S = 3.0, 15.0, 0.2
START_S_MAX = 30.0
Arrivals = dict[tuple[float, float], float]
"""Time [s] of arrival by the pose x, y [m] of a sample."""


def run(as_json: bool, rows: str = "*") -> int:
    """Print the rows of the groups `bridge` and `member` that match; return 0 if all hold, else 1."""
    groups = {"bridge": _bridge_rows, "member": member_rows}
    chosen = [group for name, group in groups.items() if fnmatchcase(name, rows.split("/")[0])]
    if not chosen:
        raise Refused(f"--rows {rows!r}: no row has such a name; they begin with {', '.join(groups)}")
    return show(chain.from_iterable(group(_free_endpoint()) for group in chosen), as_json)


def _free_endpoint() -> str:
    with socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{free.getsockname()[1]}"


def _bridge_rows(endpoint: str) -> Iterator[list[BenchRow]]:
    with Team(endless(ROBOTS)) as team:
        team.await_chain(ROBOTS)
        pause(team, SETTLE_S)
        with listen(team.fleet, frozenset({"*/status", "robot1/sensors"}), every=True) as subscriber:
            pause(team, WATCHED_S)
            alone = _lag_ms(subscriber, {})
            words = [*LFA, "ros", "--serve", "--ros", endpoint, "--fleet", team.fleet.name]
            words += ["--connect", team.fleet.endpoint]
            with started(words, stdout=subprocess.DEVNULL) as bridge:
                pause(team, SETTLE_S)
                yield from _with_bridge(team, subscriber, bridge, endpoint, alone)


def _with_bridge(
    team: Team, subscriber: Subscriber, bridge: subprocess.Popen[bytes], endpoint: str, alone: float
) -> Iterator[list[BenchRow]]:
    session = _session(team, endpoint)
    try:
        node = RosSpace(session, 0, "jazzy", Wake()).node("bench")
        topics = [*fleet_topics(tf_per_robot=False, sim_time=False)]
        for robot in range(1, ROBOTS + 1):
            topics += robot_topics(robot, tf_per_robot=False)
        heard = {topic.name: node.subscription(topic.name, topic.type, topic.qos) for topic in topics}
        pause(team, SETTLE_S)
        raw: Arrivals = {}
        bridged: Arrivals = {}
        _lag_ms(subscriber, raw)
        before, count, lags = cpu_s(bridge), 0, []
        for _ in range(round(WATCHED_S / STEP_S)):
            pause(team, STEP_S)
            lags.append(_lag_ms(subscriber, raw))
            count += _take(heard, bridged)
        share = 100.0 * (cpu_s(bridge) - before) / WATCHED_S
    finally:
        session.close()
    later = sorted(1e3 * (at - raw[pose]) for pose, at in bridged.items() if pose in raw)
    watched = statistics.median(lag for lag in lags if isfinite(lag))
    yield [
        row("bridge", Quantity("share of a core", "%", 8.0), share),
        row("bridge", Quantity("resident memory", "MB", 60.0), _rss_mb(bridge.pid)),
        row("bridge", Quantity("messages a second", "1/s"), count / WATCHED_S),
    ]
    yield [
        row("bridge/odom after sensors", Quantity("p50", "ms", 1.0), later[len(later) // 2]),
        row("bridge/odom after sensors", Quantity("p99", "ms"), later[len(later) * 99 // 100]),
        row("bridge/odom after sensors", Quantity("samples", "1"), float(len(later))),
    ]
    yield [
        row("bridge/loop lag", Quantity("median without the bridge", "ms"), alone),
        row("bridge/loop lag", Quantity("median with the bridge", "ms", max(1.25 * alone, alone + 0.5)), watched),
    ]


def _session(team: Team, endpoint: str) -> RosSession:
    """Return a session at the bridge, as soon as it answers. Raises Refused."""
    until = clock.now() + START_S_MAX
    while True:
        try:
            return ros_session(endpoint, serve=False)
        except Refused:
            if clock.now() > until:
                raise
            pause(team, STEP_S)


def _lag_ms(subscriber: Subscriber, raw: Arrivals) -> float:
    """Return the median loop lag [ms] since the last call (nan for none); note arrivals of `sensors`."""
    lags = []
    for arrival, message in subscriber.take():
        if isinstance(message, Status) and "loop_lag_ms" in message.counters:
            lags.append(message.counters["loop_lag_ms"])
        elif isinstance(message, Sensors):
            raw[message.pose_odom.x, message.pose_odom.y] = arrival.at
    return statistics.median(lags) if lags else float("nan")


def _take(heard: dict[str, RosSubscription], bridged: Arrivals) -> int:
    count = 0
    for topic, subscription in heard.items():
        for at, message in subscription.take_timed():
            count += 1
            if topic == "/robot1/odom":
                place = message.pose.pose.position
                bridged[place.x, place.y] = at
    return count


def _rss_mb(pid: int) -> float:
    found = re.search(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    return 0.0 if found is None else int(found[1]) / 1000.0
