"""Metrics of one fleet, from its messages. Pure: the times of messages and of a reading are arguments.

Their number is bounded, whatever members send: by robots, kinds of events and processes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from lfa.deploy.client.fleet_state import FleetState
from lfa.deploy.metrics.exposition import Family, MetricSample
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import LeaseNote, Propose, Role
from lfa.protocol.messages.fleet import HostStatus
from lfa.protocol.messages.robot import Sensors
from lfa.protocol.messages.team import Event
from lfa.protocol.names import robot_id_of, robot_name
from lfa.protocol.topics import TOPIC, address

ROBOTS_MAX = 256
KINDS_MAX = 48
"""Number of kinds of events counted by name; further ones are counted as `other`."""
KIND_CHARACTERS_MAX = 64
HOSTS_MAX, PROCESSES_MAX = 64, 1024
STALE_S = 3.0
"""Age [s] from which a robot's own report is outdated."""

TERM = Family("lfa_term", "gauge", "", "Number of the newest term that the robot's pose names.")
ROLE = Family("lfa_role", "gauge", "", "1 for the robot's present role (leader, follower, waiting), else 0.")
LEASE_AGE = Family("lfa_lease_age_seconds", "gauge", "seconds", "Time since the holder of the lease last renewed it.")
POSE_AGE = Family("lfa_pose_age_seconds", "gauge", "seconds", "Age of the robot's last pose.")
SPEED = Family("lfa_speed", "gauge", "", "Speed of the robot by its own pose [m/s].")
ERROR = Family("lfa_tracking_error_meters", "gauge", "meters", "Distance of a follower from its slot, by its estimate.")
LAG = Family("lfa_loop_lag_seconds", "gauge", "seconds", "Largest lateness of the agent's loop in the last second.")
TICK = Family("lfa_tick_p99_seconds", "gauge", "seconds", "Processor time of a control step, 99th percentile.")
CPU = Family("lfa_cpu_ratio", "gauge", "ratio", "Share of one processor that the agent used in the last second.")
MEMORY = Family("lfa_memory_bytes", "gauge", "bytes", "Resident memory of the agent.")
REFUSED = Family("lfa_gateway_refusals", "counter", "", "Commands that the robot's gateway refused.")
LATCHED = Family("lfa_gateway_latched", "gauge", "", "1 while the gateway bars leader commands (E14), else 0.")
GATEWAY_TERM = Family("lfa_gateway_term", "gauge", "", "Highest term that the robot's gateway has seen.")
DROPPED = Family("lfa_agent_dropped", "counter", "", "Messages that the agent dropped, by reason.")
EVENTS = Family("lfa_events", "counter", "", "Events heard, by kind.")
MESSAGES = Family("lfa_router_messages", "counter", "", "Messages that the router passed on, by topic.")
BYTES = Family("lfa_router_bytes", "counter", "bytes", "Payload that the router passed on, by topic.")
LOST = Family("lfa_observer_dropped", "counter", "", "Messages that lfa metrics dropped: its inbox was full.")
RUNNING = Family("lfa_process_running", "gauge", "", "1 while the process runs on its machine, else 0.")
STARTS = Family("lfa_process_starts", "counter", "", "Starts of the process by its supervisor.")
FLEET = Family("lfa_fleet", "info", "", "Name of the fleet.")
FAMILIES = (
    FLEET, TERM, ROLE, LEASE_AGE, POSE_AGE, SPEED, ERROR, LAG, TICK, CPU, MEMORY, REFUSED, LATCHED, GATEWAY_TERM,
    DROPPED, EVENTS, MESSAGES, BYTES, LOST, RUNNING, STARTS,
)  # fmt: skip


class FleetMetrics:
    """Metrics of the fleet `name`, updated by `update`, read by `samples`."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._state = FleetState()
        self._sensors: dict[int, Sensors] = {}
        self._renewed: tuple[int, float] | None = None
        """Holder of the lease, and when it last renewed it [s]."""
        self._term = 0
        self._events: Counter[str] = Counter()
        self._messages: Counter[str] = Counter()
        self._bytes: Counter[str] = Counter()

    def update(self, at: float, key: str, size: int, message: Message) -> None:
        """Update the metrics by a message of `size` bytes that arrived on `key` at `at` [s]."""
        where = address(key)
        if where is None or where.topic not in TOPIC:
            return
        self._messages[where.topic] += 1
        self._bytes[where.topic] += size
        robot = robot_id_of(where.owner)
        match message:
            case LeaseNote(body=Propose() as propose) if robot is not None and propose.holder.id == robot:
                if propose.term.n >= self._term:
                    self._term, self._renewed = propose.term.n, (robot, at)
            case Sensors() if robot is not None and self._admits(robot):
                self._sensors[robot] = message
            case Event():
                kind = message.kind[:KIND_CHARACTERS_MAX]
                self._events[kind if kind in self._events or len(self._events) < KINDS_MAX else "other"] += 1
            case HostStatus() if message.host not in self._state.hosts and len(self._state.hosts) >= HOSTS_MAX:
                return
        sender = robot_id_of(message.header.sender)
        if sender is None or self._admits(sender):
            self._state.update(at, message)

    def samples(self, now: float, dropped: int = 0) -> Iterator[MetricSample]:
        """Yield all values at `now` [s]. `dropped`: messages that this observer lost."""
        yield MetricSample(FLEET, 1, (("fleet", self._name),))
        yield MetricSample(LOST, dropped)
        if self._renewed is not None:
            yield MetricSample(LEASE_AGE, max(0.0, now - self._renewed[1]), _robot(self._renewed[0]))
        for robot in sorted(self._state.poses):
            yield from self._of_pose(robot, now)
        for name, status in self._state.status.items():
            robot_id = robot_id_of(name)
            if robot_id and now - status.at < STALE_S:
                yield from _of_counters(_robot(robot_id), status.message.counters)
        for robot, sensors in self._sensors.items():
            yield MetricSample(REFUSED, max(0, sensors.refused), _robot(robot))
            yield MetricSample(LATCHED, sensors.latched, _robot(robot))
            yield MetricSample(GATEWAY_TERM, sensors.term_max.n, _robot(robot))
        yield from (MetricSample(EVENTS, count, (("kind", kind),)) for kind, count in self._events.items())
        yield from (MetricSample(MESSAGES, count, (("topic", topic),)) for topic, count in self._messages.items())
        yield from (MetricSample(BYTES, count, (("topic", topic),)) for topic, count in self._bytes.items())
        yield from self._of_hosts()

    def _admits(self, robot: int) -> bool:
        return robot in self._state.poses or robot in self._sensors or len(self._state.poses) < ROBOTS_MAX

    def _of_pose(self, robot: int, now: float) -> Iterator[MetricSample]:
        """Yield what a robot's pose says; an outdated one has an age only."""
        heard, label = self._state.poses[robot], _robot(robot)
        yield MetricSample(POSE_AGE, max(0.0, now - heard.at), label)
        pose = self._state.fresh(robot, now)
        for role in Role:
            yield MetricSample(ROLE, pose is not None and pose.role is role, (*label, ("role", role.value)))
        if pose is None:
            return
        yield MetricSample(TERM, pose.term.n, label)
        yield MetricSample(SPEED, pose.twist.linear_x, label)
        tracked = self._state.tracking.get(robot)
        if tracked is not None and pose.role is Role.FOLLOWER and now - tracked.at < STALE_S:
            yield MetricSample(ERROR, abs(tracked.message.error_m), label)

    def _of_hosts(self) -> Iterator[MetricSample]:
        left = PROCESSES_MAX
        for host in sorted(self._state.hosts):
            for report in self._state.hosts[host].message.processes[:left]:
                left -= 1
                labels = (("host", host[:KIND_CHARACTERS_MAX]), ("process", report.name[:KIND_CHARACTERS_MAX]))
                yield MetricSample(RUNNING, report.state == "running", labels)
                yield MetricSample(STARTS, max(0, report.starts), labels)


#     counter of a status  family   factor
_COUNTERS = {
    "loop_lag_ms": (LAG, 1e-3),
    "tick_p99_ms": (TICK, 1e-3),
    "cpu_percent": (CPU, 1e-2),
    "rss_mib": (MEMORY, 1024.0 * 1024.0),
}
_REASONS = {"dropped": "inbox full", "undecodable": "undecodable"}


def _of_counters(label: tuple[tuple[str, str], ...], counters: dict[str, float]) -> Iterator[MetricSample]:
    for name, (family, factor) in _COUNTERS.items():
        if name in counters:
            yield MetricSample(family, counters[name] * factor, label)
    for name, reason in _REASONS.items():
        if name in counters:
            yield MetricSample(DROPPED, max(0.0, counters[name]), (*label, ("reason", reason)))


def _robot(robot: int) -> tuple[tuple[str, str], ...]:
    return (("robot", robot_name(robot)),)
