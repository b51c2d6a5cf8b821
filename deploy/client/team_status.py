"""Data of `lfa watch`: the state of every robot, the leaders of the last minutes, and recent events.

Pure: times are passed in with the messages, on the observer's own clock.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from msgspec import Struct

from lfa.deploy.client.fleet_state import FRESH_S, FleetState
from lfa.protocol.geometry import wrap
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.team import Event, Level, Status, Tracking
from lfa.protocol.names import robot_id_of, robot_name
from lfa.protocol.topics import TOPIC

LEADER_STEP_S = 1.0
LEADERS_KEPT = 300
EVENTS_KEPT = 50
STATUS_S_MAX = TOPIC["status"].timeout_s or 3.0
LISTED_MAX = 12
TEXT_MAX = 200
"""Number of characters shown of one value of an event."""
DULL = ("peer_up", "peer_down")


class RobotStatus(Struct, frozen=True):
    """Status of one robot; None: not reported."""

    robot: int
    role: str
    term: int | None
    predecessor: int | None
    error_m: float | None
    """Distance [m] from its slot, by its own estimate."""
    heading_error_rad: float | None
    """Difference [rad] between the heading that keeps it in its slot and its own, by its own estimate."""
    speed_mps: float | None
    pose_age_s: float | None
    state: str
    loop_lag_ms: float | None
    cpu_percent: float | None
    rss_mib: float | None


class Happened(Struct, frozen=True):
    """One event as a line for people; `at` is the observer's time [s]."""

    at: float
    who: str
    what: str


class Board:
    """Status of a fleet, updated from messages by `see` and `sample`, read from `rows`, `leaders` and `events`."""

    def __init__(self, robots: tuple[int, ...] = ()) -> None:
        self._state = FleetState()
        self._robots = set(robots)
        self._sampled_at: float | None = None
        self.leaders: deque[int | None] = deque(maxlen=LEADERS_KEPT)
        """Leader's id, a sample each `LEADER_STEP_S`, newest last; None: no leader."""
        self.events: deque[Happened] = deque(maxlen=EVENTS_KEPT)

    def see(self, at: float, message: Message) -> None:
        """Update the status from one message received at `at` [s]."""
        robot = robot_id_of(message.header.sender)
        if isinstance(message, Event):
            self._happened(at, message)
        if robot:
            self._robots.add(robot)
            self._state.update(at, message)

    def sample(self, now: float) -> None:
        """Append the present leader to `leaders`, once each `LEADER_STEP_S`."""
        if self._sampled_at is None or now >= self._sampled_at + LEADER_STEP_S:
            self._sampled_at = now
            self.leaders.append(self.leader(now))

    def leader(self, now: float) -> int | None:
        """Return the robot that leads by the poses; None if none claims to."""
        return self._state.leader(now)

    def rows(self, now: float) -> list[RobotStatus]:
        return [self._row(robot, now) for robot in sorted(self._robots)]

    def _row(self, robot: int, now: float) -> RobotStatus:
        heard = self._state.poses.get(robot)
        pose = None if heard is None else heard.message
        said = self._state.status.get(robot_name(robot))
        status = None if said is None else said.message
        fresh = self._state.fresh(robot, now)
        if fresh is not None:
            role = fresh.role.value
        elif said is not None and said.message.level is Level.ERROR and now - said.at < STATUS_S_MAX:
            role = said.message.role.value  # it lives, and publishes no pose because it has none
        else:
            role = "silent" if pose is not None else "unheard"
        tracked = self._state.tracking.get(robot)
        recent = tracked is not None and role == "follower" and now - tracked.at < FRESH_S
        tracking = tracked.message if tracked is not None and recent else None
        counters = {} if status is None else status.counters
        return RobotStatus(
            robot=robot,
            role=role,
            term=None if pose is None else pose.term.n,
            predecessor=None if tracking is None else tracking.predecessor,
            error_m=None if tracking is None else float(tracking.error_m),
            heading_error_rad=None if tracking is None or pose is None else wrap(tracking.heading - pose.theta),
            speed_mps=None if fresh is None else fresh.twist.linear_x,
            pose_age_s=None if heard is None else max(0.0, now - heard.at),
            state=_state(role, tracking, status),
            loop_lag_ms=counters.get("loop_lag_ms"),
            cpu_percent=counters.get("cpu_percent"),
            rss_mib=counters.get("rss_mib"),
        )

    def _happened(self, at: float, event: Event) -> None:
        what = event_text("", event.kind, event.data)
        if what is not None:
            self.events.append(Happened(at, event.header.sender, what))


def event_text(who: str, kind: str, data: dict[str, Any]) -> str | None:
    """Format an event as a line for people; None for an event that is not shown."""
    if kind in DULL:
        return None
    facts = ", ".join(
        _short(value) if name == kind else f"{name} {_short(value)}"
        for name, value in data.items()
        if name != "t" and value is not None
    )
    return f"{who} {kind} {facts}".strip()


def _state(role: str, tracking: Tracking | None, status: Status | None) -> str:
    if tracking is not None:
        return f"{tracking.state}, avoids" if tracking.avoiding else tracking.state
    if role in ("silent", "unheard") or status is None or status.text == role:
        return ""
    return status.text


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.3g}"
    if isinstance(value, list | tuple) and len(value) > LISTED_MAX:
        return f"{_short(value[:3])}-...-{_short(value[-1])} ({len(value)})"
    if isinstance(value, list | tuple):
        return "-".join(_short(item) for item in value)
    text = str(value)
    return text if len(text) <= TEXT_MAX else f"{text[:TEXT_MAX]}..."
