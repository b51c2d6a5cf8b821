"""The bridge to ROS 2 beside a running team of four: its cost, how late its topics come, what the agents feel.

Beside the bridge a relay takes the same way with raw Zenoh: it receives one robot's `sensors` and publishes the bytes
at a router of its own. One process listens to the fleet, the relay and the bridge at once, so that the machine's load
delays all alike; a sample is recognised by its pose. Processor time is that of the bridge's process alone. A bare
process, which receives and sends as much without any computation, is measured by the same steps right after: what this
machine asks for at that time.
"""

from __future__ import annotations

import re
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from math import isfinite
from pathlib import Path

import msgspec
from msgspec import Struct

from lfa.deploy.bench.harness.bare_process import BareTask, Saying
from lfa.deploy.bench.harness.child_process import LFA, cpu_s, pause, started
from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row
from lfa.deploy.bench.harness.team import Team, endless
from lfa.deploy.client.session import Subscriber, listen
from lfa.deploy.ros.bridge.bridge import ALWAYS, PULLED_FAST, PULLED_SLOWLY
from lfa.deploy.ros.topics import ON_DEMAND, RosTopic, fleet_topics, robot_topics
from lfa.deploy.ros.types import BadRosMessage, from_cdr, type_hash
from lfa.deploy.ros.wire import data_key
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import BadMessage, decode
from lfa.protocol.messages.robot import Sensors
from lfa.protocol.messages.team import Status
from lfa.protocol.transport.zenoh_ros import RosSession, ros_session

ROBOTS = 4
SETTLE_S, WINDOW_S, WINDOWS, STEP_S = 3.0, 5.0, 5, 0.2
START_S_MAX = 30.0
WATCHED, SOURCE = "/robot1/odom", "robot1/sensors"
"""Topic whose delay is measured, and what its messages are made of."""
RELAYED = "raw/robot1/sensors"
Arrivals = dict[tuple[float, float], float]
"""Time [s] of arrival by the pose x, y [m] of a sample."""
CPU = Quantity("share of a core", "%", 8.0)
AT_REST = Quantity("share of a core", "%", 4.0)
MEMORY = Quantity("resident memory", "MB", 60.0)
ADDED = Quantity("p50", "ms", 1.0)


class Watched(Struct, frozen=True):
    """What was seen of a process over several windows."""

    cpu_percent: float
    """Share of a core: the median of the windows."""
    memory_mb: float
    says: tuple[Saying, ...]
    later_ms: tuple[float, ...]
    """Delay of the watched topic behind the fleet's own `sensors`, sorted."""
    added_ms: tuple[float, ...]
    """Delay of the watched topic behind what the relay sends, sorted; empty without a relay."""
    relayed_ms: tuple[float, ...]
    """Delay of what the relay sends behind the fleet's own `sensors`, sorted; empty without a relay."""
    lag_ms: float
    """Median of the agents' loop lags."""


def bridge_rows(endpoint: str, relay_endpoint: str) -> Iterator[list[BenchRow]]:
    """Yield the rows; free TCP endpoints for the ROS router and for that of the relay."""
    with Team(endless(ROBOTS)) as team:
        team.await_chain(ROBOTS)
        pause(team, SETTLE_S)
        with listen(team.fleet, frozenset({"*/status", SOURCE}), every=True) as subscriber:
            pause(team, WINDOWS * WINDOW_S)
            alone_ms = _take(subscriber, {})
            words = [*LFA, "ros", "--serve", "--ros", endpoint, "--fleet", team.fleet.name]
            with started([*words, "--connect", team.fleet.endpoint]) as bridge:
                _session(team, endpoint).close()
                pause(team, SETTLE_S)
                rest_percent = statistics.median(_windows(team, bridge))
                unheard_ms = _take(subscriber, {})
                with started(_words(_relay_task(team, relay_endpoint))):
                    seen = _watch(team, subscriber, bridge, endpoint, relay_endpoint)
            with started(_words(_bare_task(team, endpoint, seen.says))) as bare:
                floor = _watch(team, subscriber, bare, endpoint)
    yield _rows(seen, "bridge", CPU, MEMORY)
    relayed_ms = _percentile(seen.relayed_ms, 50)
    yield [
        row("bridge/odom after the relay", ADDED, _percentile(seen.added_ms, 50)),
        row("bridge/odom after the relay", Quantity("p99", "ms"), _percentile(seen.added_ms, 99)),
        row("bridge/relay after sensors", Quantity("p50", "ms"), relayed_ms),
        row("bridge/relay after sensors", Quantity("p99", "ms"), _percentile(seen.relayed_ms, 99)),
        row(
            "bridge", Quantity("bridge's delay over the relay's", "ratio"), _percentile(seen.later_ms, 50) / relayed_ms
        ),
    ]
    yield _rows(floor, "bridge/bare process", *map(_without_bar, (CPU, MEMORY)))
    yield [row("bridge/nobody listens", AT_REST, rest_percent)]
    bar_ms = max(1.25 * alone_ms, alone_ms + 0.5)
    yield [
        row("bridge/loop lag", Quantity("median without the bridge", "ms"), alone_ms),
        row("bridge/loop lag", Quantity("median with the bridge", "ms", bar_ms), unheard_ms),
        row("bridge/loop lag", Quantity("median with all topics heard", "ms", bar_ms), seen.lag_ms),
        row("bridge/loop lag", Quantity("median with the bare process", "ms"), floor.lag_ms),
    ]


def _without_bar(quantity: Quantity) -> Quantity:
    return Quantity(quantity.name, quantity.unit)


def _rows(seen: Watched, name: str, cpu: Quantity, memory: Quantity) -> list[BenchRow]:
    return [
        row(name, cpu, seen.cpu_percent),
        row(name, memory, seen.memory_mb),
        row(name, Quantity("messages a second", "1/s"), sum(one.rate_hz for one in seen.says)),
        row(f"{name}/odom after sensors", Quantity("p50", "ms"), _percentile(seen.later_ms, 50)),
        row(f"{name}/odom after sensors", Quantity("p99", "ms"), _percentile(seen.later_ms, 99)),
    ]


def _percentile(ordered: tuple[float, ...], percent: int) -> float:
    """Return a percentile of sorted numbers; nan for none."""
    return ordered[len(ordered) * percent // 100] if ordered else float("nan")


def _watch(
    team: Team, subscriber: Subscriber, process: subprocess.Popen[bytes], endpoint: str, relay_endpoint: str = ""
) -> Watched:
    """Listen to all topics of the ROS router at `endpoint`, which `process` is, and to the relay if there is one."""
    with ExitStack() as open_sessions:
        session = open_sessions.enter_context(closing(_session(team, endpoint)))
        relayed: Arrivals = {}
        if relay_endpoint:
            relay = open_sessions.enter_context(closing(_session(team, relay_endpoint)))
            kept = relay.subscriber(RELAYED, _note(relayed), kept=None)
        heard = [_Heard(session, topic) for topic in _topics()]
        pause(team, SETTLE_S)
        raw: Arrivals = {}
        _take(subscriber, raw)
        since = clock.now()
        for one in heard:
            one.begin()
        shares = list(_windows(team, process))
        says = tuple(one.said(clock.now() - since) for one in heard)
        lag_ms = _take(subscriber, raw)
        watched = next(one for one in heard if one.topic == WATCHED)
        bridged = {pose: at for at, payload in watched.samples if (pose := _pose(payload)) is not None}
        if relay_endpoint:
            kept.undeclare()
    return Watched(
        statistics.median(shares),
        _rss_mb(process.pid),
        says,
        _delays_ms(raw, bridged),
        _delays_ms(relayed, bridged),
        _delays_ms(raw, relayed),
        lag_ms,
    )


def _delays_ms(before: Arrivals, after: Arrivals) -> tuple[float, ...]:
    """Return the delays [ms] of the samples that arrived in both ways, sorted."""
    return tuple(sorted(1e3 * (at - before[pose]) for pose, at in after.items() if pose in before))


def _note(arrivals: Arrivals) -> Callable[[str, bytes, bytes], None]:
    """Return a callback that notes when samples arrive."""

    def on_sample(_key: str, payload: bytes, _attached: bytes) -> None:
        at = clock.now()
        pose = _pose(payload)
        if pose is not None:
            arrivals[pose] = at

    return on_sample


def _windows(team: Team, process: subprocess.Popen[bytes]) -> Iterator[float]:
    """Yield the process's share of a core [%] in each of several windows."""
    for _ in range(WINDOWS):
        since, before = clock.now(), cpu_s(process)
        pause(team, WINDOW_S)
        yield 100.0 * (cpu_s(process) - before) / (clock.now() - since)


class _Heard:
    """Subscription to one ROS topic that counts; it keeps the samples of the watched one."""

    def __init__(self, session: RosSession, topic: RosTopic) -> None:
        self.topic = topic.name
        self.samples: list[tuple[float, bytes]] = []
        self._key = data_key(0, topic.name, topic.type, type_hash(topic.type))
        self._count = self._size = 0
        self._subscriber = session.subscriber(self._key, self._on_sample, kept=1 if topic.qos.latched else None)

    def begin(self) -> None:
        self._count = 0
        self.samples.clear()

    def said(self, duration_s: float) -> Saying:
        """Return the stream heard in `duration_s` since `begin`."""
        return Saying(self._key, self._size, self._count / duration_s)

    def _on_sample(self, _key: str, payload: bytes, _attached: bytes) -> None:
        self._count, self._size = self._count + 1, len(payload)
        if self.topic == WATCHED:
            self.samples.append((clock.now(), payload))


def _topics() -> list[RosTopic]:
    topics = [*fleet_topics(tf_per_robot=False, sim_time=False)]
    for robot in range(1, ROBOTS + 1):
        topics += robot_topics(robot, tf_per_robot=False)
    return topics


def _words(task: BareTask) -> list[str]:
    """Return the command that runs a bare process."""
    program = [sys.executable, "-P", "-m", "lfa.deploy.bench.harness.bare_process"]
    return [*program, msgspec.json.encode(task).decode()]


def _relay_task(team: Team, endpoint: str) -> BareTask:
    """Return the task to relay the watched topic's source, at a router of its own, and nothing else."""
    source = f"lfa/{team.fleet.name}/{SOURCE}"
    return BareTask(team.fleet.endpoint, (source,), (), endpoint, relays={source: RELAYED})


def _bare_task(team: Team, endpoint: str, says: tuple[Saying, ...]) -> BareTask:
    """Return the task to receive what the bridge receives and to send what it was heard to send.

    Odometry is relayed: the bytes of `sensors`, as soon as they come.
    """
    fleet = f"lfa/{team.fleet.name}"
    odom = {int(one.key.split("/")[1].removeprefix("robot")): one.key for one in says if "/odom/" in one.key}
    relays = {f"{fleet}/robot{robot}/sensors": key for robot, key in odom.items()}
    return BareTask(
        team.fleet.endpoint,
        tuple(f"{fleet}/{topic}" for topic in sorted(ALWAYS | ON_DEMAND)),
        tuple(one for one in says if one.key not in odom.values()),
        endpoint,
        tuple(f"{fleet}/{topic}" for topic in sorted(PULLED_FAST | PULLED_SLOWLY)),
        relays,
    )


def _session(team: Team, endpoint: str) -> RosSession:
    """Return a session at the router, as soon as it answers. Raises Refused."""
    until = clock.now() + START_S_MAX
    while True:
        try:
            return ros_session(endpoint, serve=False)
        except Refused:
            if clock.now() > until:
                raise
            pause(team, STEP_S)


def _take(subscriber: Subscriber, raw: Arrivals) -> float:
    """Return the median loop lag [ms] since the last call (nan for none); note arrivals of `sensors`."""
    lags = []
    for arrival, message in subscriber.take():
        if isinstance(message, Status) and "loop_lag_ms" in message.counters:
            lags.append(message.counters["loop_lag_ms"])
        elif isinstance(message, Sensors):
            raw[message.pose_odom.x, message.pose_odom.y] = arrival.at
    return statistics.median(lag for lag in lags if isfinite(lag)) if lags else float("nan")


def _pose(payload: bytes) -> tuple[float, float] | None:
    """Return x, y [m] of the watched topic's message: of the bridge odometry, of a bare process what it relays."""
    try:
        place = decode(payload, Sensors).pose_odom  # type: ignore[union-attr]
    except BadMessage:
        try:
            place = from_cdr(payload, "nav_msgs/msg/Odometry").pose.pose.position
        except BadRosMessage:
            return None
    return place.x, place.y


def _rss_mb(pid: int) -> float:
    found = re.search(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    return 0.0 if found is None else int(found[1]) / 1000.0
