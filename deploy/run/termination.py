"""Termination of a run: the verdict, decided once from the messages. Pure: time comes with the messages.

A run has reached its goal when the leader of the present chain says that it has driven the whole route and arrived, the
ground truth shows it there, and all robots of that chain have been at rest in their slots for `REST_S`. It has failed
when an agent publishes a `failed` event, and has run out of time when the world's clock passes the scenario's limit.
"""

from __future__ import annotations

from itertools import pairwise
from math import hypot, inf

from lfa.agents.leading.free_place import FREE_WITHIN_M
from lfa.deploy.recording.outcome import Verdict
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import NO_TERM, Role, Term
from lfa.protocol.messages.orders import OrderNote
from lfa.protocol.messages.simulation import TrueRobot, Truth
from lfa.protocol.messages.team import Event, RouteProgress, Status, TableRow, Tracking
from lfa.protocol.names import robot_id_of
from lfa.protocol.topics import TOPIC
from lfa.world.description.load import Scenario

REST_S = 0.5
REST_SPEED = 1e-3  # [m/s] and [rad/s]
SLOT_SHARE = 0.5
"""Distance of a robot at rest from its slot up to which it is in it, as a share of its commanded distance k^d."""
TRACKING_S_MAX = TOPIC["tracking"].timeout_s or 1.0

GAVE_WAY_S = 10.0
"""Time [s] for which a robot's decision about what moves counts as what keeps it from its place."""

JUDGED = frozenset({Truth, TableRow, Tracking, Event, Status, OrderNote})
"""Types of the messages that tell something about the end of a run; one in two is of another."""


class Termination:
    """Judge of a run from every Truth and Event; `verdict` is None until the run is over.

    `chain` is the present chain, `leader` the robot whose leader command of the highest term was accepted last.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._leading = scenario.mission.leading
        """Route and tolerances that hold: the scenario's, or as an operator changed them (E32)."""
        self._order_version = self._route = 0
        """Version of the order that holds, and of the one that gave the route."""
        self._term = NO_TERM
        self._led = NO_TERM
        self.chain: tuple[int, ...] = scenario.mission.robots
        self.leader: int | None = None
        self._resting_since: float | None = None
        self._now_s = 0.0
        self._progress: dict[int, RouteProgress] = {}
        """Progress on the route as last reported by each robot."""
        self._place: tuple[float, float] | None = None
        """Place [m] that a leader takes instead of the goal, on which something stands."""
        self._tracking: dict[int, tuple[Tracking, float]] = {}
        """Last report of each follower, and when [s] it came."""
        self._gave_way_s: dict[int, float] = {}
        """Time [s] of the last decision of each robot about what moves."""
        self.verdict: Verdict | None = None

    def see(self, message: Message) -> Verdict | None:
        """Update with a message and return the verdict, or None while the run goes on."""
        if self.verdict is None and type(message) in JUDGED:
            match message:
                case Truth():
                    self._now_s = message.time_s
                    self.verdict = self._judge(message)
                case TableRow(progress=RouteProgress() as progress):
                    self._progress[robot_id_of(message.header.sender) or 0] = progress
                case OrderNote(term=Term(), order=order) if order.version > self._order_version:
                    if order.route != self._route:
                        self._place = None
                    self._leading, self._order_version, self._route = order.leading, order.version, order.route
                case Event(kind="waypoint_taken", data={"waypoint": int() as n, "x": float() as x, "y": float() as y}):
                    self._take_place(n, x, y)
                case Event(kind="decision", data={"class": "moving"}):
                    self._gave_way_s[robot_id_of(message.header.sender) or 0] = self._now_s
                case Tracking():
                    self._tracking[robot_id_of(message.header.sender) or 0] = message, self._now_s
                case Event(kind="failed"):
                    who = robot_id_of(message.header.sender)
                    reason = str(message.data.get("reason", "gives up"))
                    self.verdict = Verdict("failed", reason if who is None else f"robot {who}: {reason}")
                case Event(kind="chain", term=Term() as term) if term >= self._term:
                    self._term = term
                    self.chain = _ids(message.data.get("chain")) or self.chain
                case Status(role=Role.LEADER, term=term, chain=chain) if term >= self._term and chain:
                    self._term, self.chain = term, chain  # said again each second, in case the event was missed
                    if term > self._led:
                        self._led, self.leader = term, chain[0]
                case Event(kind="leader_command", term=Term() as term) if term >= self._led:
                    self._led = term
                    self.leader = next(iter(_ids([message.data.get("robot")])), self.leader)
        return self.verdict

    def _judge(self, truth: Truth) -> Verdict | None:
        missing = self._missing(truth.robots)
        if missing is not None:
            self._resting_since = None
        elif self._resting_since is None:
            self._resting_since = truth.time_s
        elif truth.time_s >= self._resting_since + REST_S:
            return Verdict("goal_reached")
        if truth.time_s >= self._scenario.time_limit_s:
            why = missing or "at rest too short a time"
            return Verdict("time_limit", f"not at the goal after {self._scenario.time_limit_s:g} s: {why}")
        return None

    def _missing(self, robots: tuple[TrueRobot, ...]) -> str | None:
        """Return what is missing until the team has arrived; None when nothing is."""
        leading = self._leading
        present = {robot.id: robot for robot in robots}
        chain = [present[robot] for robot in self.chain if robot in present]
        if not chain:
            return "no robot is in the chain"
        leader, points = chain[0], leading.route_m
        progress = self._progress.get(leader.id)
        passed = 0 if progress is None or progress.route != self._route else progress.waypoint
        if passed < len(points):
            return f"robot {leader.id} is on its way to way-point {1 + passed}{self._since_gave_way(leader.id)}"
        places = [points[-1], *([] if self._place is None else [self._place])]
        if min(hypot(leader.x - x, leader.y - y) for x, y in places) > leading.goal_tolerance_m:
            return f"robot {leader.id} is off the goal"
        moving = next((robot.id for robot in chain if not _at_rest(robot)), None)
        if moving is not None:
            return f"robot {moving} moves{self._since_gave_way(moving)}"
        astray = next((robot.id for ahead, robot in pairwise(chain) if not self._in_slot(robot, ahead)), None)
        return None if astray is None else f"robot {astray} is not in its slot{self._since_gave_way(astray)}"

    def _since_gave_way(self, robot: int) -> str:
        """Return the words for how long ago [s] a robot gave way to what moves; empty where that explains nothing."""
        since_s = self._now_s - self._gave_way_s.get(robot, -inf)
        return f" (it gave way to what moves {since_s:.0f} s before)" if since_s <= GAVE_WAY_S else ""

    def _take_place(self, number: int, x: float, y: float) -> None:
        """Accept a place that replaces the goal, if it is no farther from the goal than such a place may be."""
        goal_x, goal_y = self._leading.route_m[-1]
        if number == len(self._leading.route_m) - 1 and hypot(x - goal_x, y - goal_y) <= FREE_WITHIN_M:
            self._place = x, y

    def _in_slot(self, robot: TrueRobot, ahead: TrueRobot) -> bool:
        """Return whether a follower at rest is in its slot, by its own report and by the ground truth."""
        tracking, at_s = self._tracking.get(robot.id, (None, 0.0))
        if tracking is None or tracking.predecessor != ahead.id or self._now_s > at_s + TRACKING_S_MAX:
            return False
        off_max_m = SLOT_SHARE * tracking.separation_m
        gap_m = hypot(robot.x - ahead.x, robot.y - ahead.y)
        return tracking.error_m <= off_max_m and gap_m <= tracking.separation_m + off_max_m


def _ids(said: object) -> tuple[int, ...]:
    """Return the robot ids in an event's data, which any sender may have written."""
    return tuple(i for i in said if isinstance(i, int)) if isinstance(said, list | tuple) else ()


def _at_rest(robot: TrueRobot) -> bool:
    return abs(robot.linear_x) < REST_SPEED and abs(robot.angular_z) < REST_SPEED
