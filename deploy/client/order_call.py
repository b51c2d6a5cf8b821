"""One change of a running team's mission, as its operator's side runs it (E32). Pure.

It asks the leader for the order that holds, changes it, counts up, and repeats the new one until a leader has carried
it out and more than half of the team knows it: a leader that dies meanwhile changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec import Struct, structs

from lfa.protocol.messages.orders import OrderNote, TeamOrder
from lfa.protocol.messages.team import Event
from lfa.protocol.mission import Mission
from lfa.protocol.names import robot_id_of

REPEAT_S = 0.1
ANSWER_S = 5.0
"""Time [s] within which a leader carries an order out; an election lasts well below it."""

Change = Callable[[Mission, Mission], Mission]
"""Function that changes `leading` and `formation` of the mission that holds; the second is the mission as it began.
Raises Refused."""


class OrderOutcome(Struct, frozen=True):
    """Result of a change."""

    version: int
    leader: int | None
    """Robot that carries it out; None: none has answered in time."""
    robots: tuple[int, ...] = ()
    """Robots that know it, the leader first."""
    reason: str = ""
    """Why the leader refused it; empty if it did not."""


class OrderCall:
    """Change of a mission, asked for at `now` [s] of the operator's clock.

    `paused`: whether the leader then stands; None: as before.
    """

    def __init__(self, change: Change, paused: bool | None, now: float) -> None:
        self._change = change
        self._paused = paused
        self._begun = now
        self._mission: Mission | None = None
        self._base: TeamOrder | None = None
        self._order: TeamOrder | None = None
        self._leader: int | None = None
        self._carried = False
        """True once a leader tells this very order: another operator's may have the same version."""
        self._known: list[int] = []
        self._reason = ""
        self._say_at = now

    def hear_mission(self, mission: Mission) -> None:
        """Take the mission with which the team began."""
        self._mission = self._mission or mission

    def hear(self, message: OrderNote | Event) -> None:
        """Process what a robot says. Raises Refused if the change does not fit the mission."""
        robot = robot_id_of(message.header.sender)
        if not robot:
            return
        if isinstance(message, OrderNote):
            if self._order is not None:
                self._carried = self._carried or (message.term is not None and message.order == self._order)
            elif message.term is not None:
                self._base = message.order
                self._make()
        elif self._order is not None and message.data.get("version") == self._order.version:
            if message.kind == "order_refused" and not self._carried:
                self._reason, self._leader = str(message.data.get("reason")), robot
            elif message.kind == "order":
                self._acknowledged(robot, leads=message.data.get("by") == "leader")

    def _acknowledged(self, robot: int, *, leads: bool) -> None:
        if leads:
            self._leader = robot
        if robot not in self._known:
            self._known.insert(0 if leads else len(self._known), robot)

    def _make(self) -> None:
        """Make the new order from the one that holds."""
        if self._mission is None or self._base is None:
            return
        base = self._base
        before = structs.replace(self._mission, leading=base.leading, formation=base.formation)
        after = self._change(before, self._mission)
        version = base.version + 1
        route = base.route if after.leading.route_m == before.leading.route_m else version
        paused = base.paused if self._paused is None else self._paused
        self._order = TeamOrder(after.leading, after.formation, version, route, paused)

    def said(self, now: float) -> TeamOrder | None:
        """Return the order to publish now, or None if none is due."""
        if self._order is None:
            self._make()
        if self._order is None or now < self._say_at:
            return None
        self._say_at = now + REPEAT_S
        return self._order

    def outcome(self, now: float) -> OrderOutcome | None:
        """Return the result once it is final."""
        version = 0 if self._order is None else self._order.version
        enough = self._mission is not None and 2 * len(self._known) > len(self._mission.robots)
        done = self._carried and self._leader is not None and enough
        if self._reason or done or now - self._begun >= ANSWER_S:
            leader = self._leader if self._carried or self._reason else None
            return OrderOutcome(version, leader, tuple(self._known), self._reason)
        return None
