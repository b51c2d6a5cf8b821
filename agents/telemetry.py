"""Telemetry of one agent: its pose, slot error, decisions, plan and status."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lfa.agents.avoidance.decision import Decision
from lfa.agents.navigator import Navigator
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.consensus import Role, Term, Version
from lfa.protocol.messages.team import Level, ObstacleNote, PlanNote, PoseStamped, Status, TableRow, Tracking
from lfa.protocol.names import robot_name
from lfa.protocol.node import Vitals
from lfa.protocol.outbox import Outbox

if TYPE_CHECKING:
    from lfa.agents.exploration.explorer import Explore  # a map and a planner: memory that only explorers need

TRACKING_EVERY = 2
PLAN_EVERY = 10
ROUTE_POINTS_MAX = 200
OBSTACLE_S = 0.5
TABLE_S = 0.5
TABLE_ROBOTS_FULL_RATE = 16
"""Number of robots up to which table rows keep their full rate. Larger teams publish their rows less often, because the
table's traffic grows with the square of their number."""
FAR_M = 99.0


class Reports:
    """Publisher of one robot's reports, each at its own rate."""

    def __init__(self, outbox: Outbox, robots: int) -> None:
        self._outbox = outbox
        self._table_s = TABLE_S * max(1.0, robots / TABLE_ROBOTS_FULL_RATE)
        self._next_table = 0.0
        self._next_obstacle = 0.0
        self._steps = 0
        self._arrived = False
        self._met: tuple[str, str] | None = None

    def place(
        self, driver: Navigator, team: TeamState, near: tuple[int, ...], role: Role, term: Term,
        pose: Pose2D, twist: Twist, now: float,
    ) -> None:  # fmt: skip
        """Publish the pose after each control step; tracking and the table's row less often, but the row at once when
        the team has arrived. `near` holds the ids of the neighbours in the chain.
        """
        outbox, odometer_m = self._outbox, driver.estimator.odometer_m
        header = outbox.header("pose", now)
        outbox.publish("pose", PoseStamped(header, pose.x, pose.y, 0.0, pose.theta, twist, odometer_m, role, term))
        self._steps += 1
        if role is Role.FOLLOWER and driver.predecessor is not None and self._steps % TRACKING_EVERY == 0:
            self._tracking(driver, driver.predecessor.robot, now)
        arrived = driver.arrived(pose, driver.last)
        if now >= self._next_table or arrived > self._arrived:
            self._arrived = arrived
            self._next_table = now + self._table_s
            header, delays, stuck = outbox.header("table", now), team.delays(near, now), driver.stuck is not None
            outbox.publish(
                "table",
                TableRow(header, pose.x, pose.y, 0.0, pose.theta, odometer_m, role, delays, stuck, team.progress),
            )

    def decision(self, decision: Decision | None, term: Term, now: float) -> None:
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

    def obstacle(self, driver: Navigator, pose: Pose2D, now: float) -> None:
        """Publish the obstacle that this robot deals with: at once when it changes, then twice a second while it
        lasts.
        """
        decision = driver.decision
        if decision is None:
            self._next_obstacle = 0.0
            return
        if now < self._next_obstacle:
            return
        feature = driver.nearest(pose, decision.kind, now)
        if feature is not None:
            self._next_obstacle = now + OBSTACLE_S
            header, velocity = self._outbox.header("obstacles", now), (feature.vx, feature.vy)
            note = ObstacleNote(header, feature.kind, feature.x, feature.y, feature.radius_m, velocity)
            self._outbox.publish("obstacles", note)

    def plan(self, explore: Explore, pose: Pose2D, now: float) -> None:
        """Publish an exploring leader's route and a tile of its map, if a tile has changed."""
        if self._steps % PLAN_EVERY:
            return
        tile = explore.shown(pose)
        if tile is not None:
            step = max(1, -(-len(explore.route) // ROUTE_POINTS_MAX))
            route = (*explore.route[::step], *explore.route[-1:])
            self._outbox.publish("plan", PlanNote(self._outbox.header("plan", now), route, *tile))

    def _tracking(self, driver: Navigator, predecessor: int, now: float) -> None:
        r = driver.follower.readout
        if r.separation_m <= 0.0:  # no step of following yet: nothing to report
            return
        self._outbox.publish("tracking", Tracking(
            self._outbox.header("tracking", now), predecessor, r.separation_m, r.phi, r.chi, r.heading,
            r.slot_map, r.error_m, driver.decision is not None, r.state.value,
        ))  # fmt: skip


def status(
    outbox: Outbox, vitals: Vitals, team: TeamState, driver: Navigator | None, missing: tuple[int, ...],
    role: Role, term: Term, version: Version | None, now: float,
) -> None:  # fmt: skip
    """Publish the diagnostics (as in ROS). `driver` is None before the mission is known; `missing` lists the robots
    that are absent (E18).
    """
    counters: dict[str, float] = {
        "loop_lag_ms": round(1000.0 * vitals.loop_lag_s, 3),
        "tick_p99_ms": round(1000.0 * vitals.tick_p99_s, 3),
        "dropped": vitals.dropped,
        "undecodable": vitals.undecodable,
        "cpu_percent": round(vitals.cpu_percent, 2),
        "rss_mib": round(vitals.rss_mib, 1),
        "rows_heard": team.rows_heard,
        "rows_lost": team.rows_lost,
    }
    if version is not None:  # of the config, and so of the chain: an observer that missed the event learns it here
        counters |= {"config_n": version.term.n, "config_seq": version.seq}
    text, level = "waiting for the mission", Level.WARN
    if driver is not None:
        text, level = (role.value, Level.OK) if driver.estimator.ready else ("waiting for sensors", Level.WARN)
        if driver.estimator.ready and (lost := driver.lost_input(now)) is not None:
            text, level = f"{role.value}, no {lost} any more", Level.ERROR
        if missing:
            text, level = f"waiting for {', '.join(robot_name(i) for i in missing)}", Level.WARN
        counters |= {"outliers": driver.estimator.outliers, "refused": driver.estimator.refused}
        if driver.predecessor is not None:
            counters["predecessor_clock_offset_s"] = driver.predecessor.clock.offset(now)
            counters["predecessor_refused"] = driver.predecessor.refused
    outbox.publish("status", Status(outbox.header("status", now), level, text, role, term, counters))
