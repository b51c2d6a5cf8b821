"""Telemetry of one agent: its pose, slot error, decisions, plan and status."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lfa.agents.avoidance.decision import Decision
from lfa.agents.navigator import Navigator
from lfa.agents.team_state import TeamState, table_s
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.messages.consensus import NO_TERM, Role, Term
from lfa.protocol.messages.team import (
    REFUSED_OF,
    Level,
    ObstacleNote,
    PlanNote,
    PoseStamped,
    Status,
    TableRow,
    Tracking,
)
from lfa.protocol.names import robot_name
from lfa.protocol.node import Vitals
from lfa.protocol.outbox import Outbox
from lfa.protocol.runtime.lateness import Lateness

if TYPE_CHECKING:
    from lfa.agents.exploration.explorer import Explore  # a map and a planner: memory that only explorers need

TRACKING_EVERY = 2
PLAN_EVERY = 10
ROUTE_POINTS_MAX = 200
OBSTACLE_S = 0.5
FAR_M = 99.0


class Reports:
    """Publisher of one robot's reports, each at its own rate."""

    def __init__(self, outbox: Outbox, robots: int, late_s: float) -> None:
        """`robots`: size of the team; `late_s`: lateness [s] of the own loop that is too much."""
        self._outbox = outbox
        self.table_s = table_s(robots)
        """Time [s] between two rows of the table."""
        self._next_table = 0.0
        self._next_obstacle = 0.0
        self._steps = 0
        self._arrived = False
        self._met: tuple[str, str] | None = None
        self._lateness = Lateness(late_s)

    def step(
        self, navigator: Navigator, team: TeamState, near: tuple[int, ...], role: Role, term: Term,
        pose: Pose2D, twist: Twist, now: float,
    ) -> None:  # fmt: skip
        """Publish what is due after a control step. `near` holds the ids of the neighbours in the chain."""
        self._place(navigator, team, near, role, term, pose, twist, now)
        self._decision(navigator.decision, term, now)
        self._obstacle(navigator, pose, now)
        if role is Role.LEADER and navigator.leading.explore is not None:
            self._plan(navigator.leading.explore, pose, now)

    def _place(
        self, navigator: Navigator, team: TeamState, near: tuple[int, ...], role: Role, term: Term,
        pose: Pose2D, twist: Twist, now: float,
    ) -> None:  # fmt: skip
        """Publish the pose; tracking and the table's row less often, but the row at once when the team has arrived."""
        outbox, odometer_m = self._outbox, navigator.estimator.odometer_m
        header = outbox.header("pose", now)
        outbox.publish("pose", PoseStamped(header, pose.x, pose.y, 0.0, pose.theta, twist, odometer_m, role, term))
        self._steps += 1
        if role is Role.FOLLOWER and navigator.predecessor is not None and self._steps % TRACKING_EVERY == 0:
            self._tracking(navigator, navigator.predecessor.robot, now)
        arrived = navigator.arrived(pose, navigator.last)
        if arrived > self._arrived:
            self._next_table = now
        self._arrived = arrived
        self._row(pose, navigator, team, near, role, now)

    def step_without_pose(
        self, navigator: Navigator, team: TeamState, near: tuple[int, ...], role: Role, now: float
    ) -> None:
        """Publish what is due after a control step of a robot that has no pose: the table's row only."""
        self._row(None, navigator, team, near, role, now)

    def _row(
        self, pose: Pose2D | None, navigator: Navigator, team: TeamState, near: tuple[int, ...], role: Role, now: float
    ) -> None:
        if now < self._next_table:
            return
        self._next_table = now + self.table_s
        at, odometer_m, stuck = pose or Pose2D(), navigator.estimator.odometer_m, navigator.stuck is not None
        header, delays = self._outbox.header("table", now), team.delays(near, now)
        row = TableRow(
            header, at.x, at.y, 0.0, at.theta, odometer_m, role, delays, stuck, team.progress, pose is not None
        )
        self._outbox.publish("table", row)

    def _decision(self, decision: Decision | None, term: Term, now: float) -> None:
        """Publish each change of the decision about the surroundings, with the values that decided it."""
        met = None if decision is None else (decision.kind, decision.action)
        if met == self._met:
            return
        before, self._met = self._met, met
        data: dict[str, object] = {"class": before[0] if before is not None else "", "action": "resume"}
        if decision is not None:
            free_m, bearing = round(min(decision.free_m, FAR_M), 3), round(decision.bearing, 3)
            data |= {"class": decision.kind, "action": decision.action, "free_m": free_m, "bearing_rad": bearing}
            if decision.condition:
                data |= {"condition": decision.condition, "updates": decision.updates}
        self._outbox.event("decision", now, term, data)

    def _obstacle(self, navigator: Navigator, pose: Pose2D, now: float) -> None:
        """Publish the obstacle that this robot deals with: at once when it changes, then twice a second while it
        lasts.
        """
        decision = navigator.decision
        if decision is None:
            self._next_obstacle = 0.0
            return
        if now < self._next_obstacle:
            return
        feature = navigator.nearest(pose, decision.kind, now)
        if feature is not None:
            self._next_obstacle = now + OBSTACLE_S
            header, velocity = self._outbox.header("obstacles", now), (feature.vx, feature.vy)
            note = ObstacleNote(header, feature.kind, feature.x, feature.y, feature.radius_m, velocity)
            self._outbox.publish("obstacles", note)

    def _plan(self, explore: Explore, pose: Pose2D, now: float) -> None:
        """Publish an exploring leader's route and a tile of its map, if a tile has changed."""
        if self._steps % PLAN_EVERY:
            return
        tile = explore.shown(pose)
        if tile is not None:
            step = max(1, -(-len(explore.route) // ROUTE_POINTS_MAX))
            route = (*explore.route[::step], *explore.route[-1:])
            self._outbox.publish("plan", PlanNote(self._outbox.header("plan", now), route, *tile))

    def status(
        self, vitals: Vitals, navigator: Navigator, team: TeamState, lease: Lease, role: Role,
        outside: str, gateway: str, now: float,
    ) -> None:  # fmt: skip
        """Publish the diagnostics (as in ROS).

        `outside` says who is there and not in the chain, `gateway` what is wrong with the own one.
        """
        if self._lateness.update(vitals.loop_lag_s):
            worst_s = self._lateness.worst_s
            self._outbox.event("late", now, lease.term, {"late": worst_s > 0.0, "lag_s": round(worst_s, 3)})
        counters = _counters(vitals, team.rows_heard, team.rows_lost)
        version = lease.config.version  # and so of the chain: an observer that missed the event learns it here
        counters |= {"config_n": version.term.n, "config_seq": version.seq}
        counters |= {"outliers": navigator.estimator.outliers, "refused": navigator.estimator.refused}
        if navigator.predecessor is not None:
            counters["predecessor_clock_offset_s"] = navigator.predecessor.clock.offset(now)
            counters["predecessor_refused"] = navigator.predecessor.refused
        text, level = _health(navigator, lease, role, (self._lateness.text(), outside), now)
        if gateway:
            text, level = gateway, Level.ERROR
        outbox = self._outbox
        header = outbox.header("status", now)
        outbox.publish("status", Status(header, level, text, role, lease.term, counters, lease.chain))

    def _tracking(self, navigator: Navigator, predecessor: int, now: float) -> None:
        r = navigator.follower.readout
        if r.separation_m <= 0.0:  # no step of following yet: nothing to report
            return
        self._outbox.publish("tracking", Tracking(
            self._outbox.header("tracking", now), predecessor, r.separation_m, r.phi, r.chi, r.heading,
            r.slot_map, r.error_m, navigator.decision is not None, r.state.value,
        ))  # fmt: skip


def waiting_status(outbox: Outbox, vitals: Vitals, now: float) -> None:
    """Publish the diagnostics of an agent that waits for its mission."""
    counters = _counters(vitals, 0, 0)
    header = outbox.header("status", now)
    outbox.publish("status", Status(header, Level.WARN, "waiting for the mission", Role.WAITING, NO_TERM, counters))


def _counters(vitals: Vitals, rows_heard: int, rows_lost: int) -> dict[str, float]:
    return {
        "loop_lag_ms": round(1000.0 * vitals.loop_lag_s, 3),
        "tick_p99_ms": round(1000.0 * vitals.tick_p99_s, 3),
        "dropped": vitals.dropped,
        "undecodable": vitals.undecodable,
        "cpu_percent": round(vitals.cpu_percent, 2),
        "rss_mib": round(vitals.rss_mib, 1),
        "rows_heard": rows_heard,
        "rows_lost": rows_lost,
    } | {f"{REFUSED_OF}{member}": number for member, number in vitals.refused}


def _health(navigator: Navigator, lease: Lease, role: Role, others: tuple[str, ...], now: float) -> tuple[str, Level]:
    """Return the text and level of the status: the robots that the first election waits for (E18) come first.

    `others` are further warnings, the empty ones of which do not hold.
    """
    if lease.missing:
        awaited = f"waiting for {', '.join(robot_name(i) for i in lease.missing)}"
        return ", ".join(filter(None, (awaited, *others))), Level.WARN
    lost = navigator.limits.lost_input(now)
    if lost is None:
        slow_hz = navigator.scan_age.slow_hz
        slow = "" if slow_hz is None else f"slow: scans at {slow_hz:.1f} Hz"
        warnings = [warning for warning in (slow, *others) if warning]
        return ", ".join([role.value, *warnings]), Level.WARN if warnings else Level.OK
    if navigator.pose_lost:
        return f"{role.value}, own pose lost: no {lost}", Level.ERROR
    if not navigator.was_placed:
        return f"waiting for {lost}", Level.WARN
    return f"{role.value}, no {lost} any more", Level.ERROR
