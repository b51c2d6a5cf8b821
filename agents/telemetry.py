"""What an agent tells of itself: its place, how it stands to its slot, what it decided, how it fares."""

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
"""Larger teams say their rows less often: the table's traffic grows with their square."""
FAR_M = 99.0


class Reports:
    """Keeps the rates of one robot's reports."""

    def __init__(self, outbox: Outbox, robots: int) -> None:
        self._outbox = outbox
        self._table_s = TABLE_S * max(1.0, robots / TABLE_ROBOTS_FULL_RATE)
        self._next_table = 0.0
        self._next_obstacle = 0.0
        self._steps = 0
        self._met: tuple[str, str] | None = None

    def place(
        self, driver: Navigator, team: TeamState, near: tuple[int, ...], role: Role, term: Term,
        pose: Pose2D, twist: Twist, now: float,
    ) -> None:  # fmt: skip
        """After each control step: pose; less often tracking and the table's row. `near` are its neighbours' ids."""
        outbox, odometer_m = self._outbox, driver.estimator.odometer_m
        header = outbox.header("pose", now)
        outbox.publish("pose", PoseStamped(header, pose.x, pose.y, 0.0, pose.theta, twist, odometer_m, role, term))
        self._steps += 1
        if role is Role.FOLLOWER and driver.predecessor is not None and self._steps % TRACKING_EVERY == 0:
            self._tracking(driver, driver.predecessor.robot, now)
        if now >= self._next_table:
            self._next_table = now + self._table_s
            header, delays, stuck = outbox.header("table", now), team.delays(near, now), driver.stuck is not None
            outbox.publish("table", TableRow(header, pose.x, pose.y, 0.0, pose.theta, odometer_m, role, delays, stuck))

    def decision(self, decision: Decision | None, term: Term, now: float) -> None:
        """Each change of what a robot does about its surroundings, with the values that decided it."""
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
        """What this robot is dealing with, for all: at once when it changes, and while it lasts twice a second."""
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
        """Of who leads through unknown ground: its route, and a tile of its map where there is news."""
        if self._steps % PLAN_EVERY:
            return
        tile = explore.shown(pose)
        if tile is not None:
            step = max(1, -(-len(explore.route) // ROUTE_POINTS_MAX))
            route = (*explore.route[::step], *explore.route[-1:])
            self._outbox.publish("plan", PlanNote(self._outbox.header("plan", now), route, *tile))

    def _tracking(self, driver: Navigator, predecessor: int, now: float) -> None:
        r = driver.follower.readout
        if r.separation_m <= 0.0:  # no step of following was made yet: there is nothing to tell
            return
        self._outbox.publish("tracking", Tracking(
            self._outbox.header("tracking", now), predecessor, r.separation_m, r.phi, r.chi, r.heading,
            r.slot_map, r.error_m, driver.decision is not None, r.state.value,
        ))  # fmt: skip


def status(
    outbox: Outbox, vitals: Vitals, team: TeamState, driver: Navigator | None, missing: tuple[int, ...],
    role: Role, term: Term, version: Version | None, now: float,
) -> None:  # fmt: skip
    """Diagnostics in the sense of ROS. `driver` is None before the mission is known; `missing` stay away (E18)."""
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
    if version is not None:  # of the config, and so of the chain: who missed the event knows it by this
        counters |= {"config_n": version.term.n, "config_seq": version.seq}
    text, level = "waiting for the mission", Level.WARN
    if driver is not None:
        text, level = (role.value, Level.OK) if driver.estimator.ready else ("waiting for sensors", Level.WARN)
        if missing:
            text, level = f"waiting for {', '.join(robot_name(i) for i in missing)}", Level.WARN
        counters |= {"outliers": driver.estimator.outliers, "refused": driver.estimator.refused}
        if driver.predecessor is not None:
            counters["predecessor_clock_offset_s"] = driver.predecessor.clock.offset(now)
            counters["predecessor_refused"] = driver.predecessor.refused
    outbox.publish("status", Status(outbox.header("status", now), level, text, role, term, counters))
