"""The operator's orders to the team at one robot: what it may change of the mission, and from whom (E32).

Every robot hears what the operator proposes, and keeps the newest. The leader checks it, carries it out, and says it
again once a second under its term; a new leader goes on with the newest order that it knows. Two operators may have
counted on from the same order, each heard by another leader: of two orders of one version, that of the later term
holds. A robot that knows a higher version than its leader says tells the leader.
"""

from __future__ import annotations

from msgspec import structs

from lfa.protocol.errors import Refused
from lfa.protocol.lease.term_window import TermWindow
from lfa.protocol.messages.consensus import NO_TERM, Term
from lfa.protocol.messages.orders import OrderNote, TeamOrder
from lfa.protocol.mission import Mission
from lfa.protocol.mission_checks import check_mission
from lfa.protocol.outbox import Outbox

REPEAT_S = 1.0
REMIND_S = 2.0
"""Time [s] for which a leader may say no order before a robot that knows one tells it, longer than `REPEAT_S`."""
QUESTION = "team_order"


class TeamOrders:
    """Newest order at one robot, and the mission by it."""

    def __init__(self, outbox: Outbox, mission: Mission) -> None:
        self._outbox = outbox
        self.mission = mission
        """Mission as the newest order changes it."""
        self.order = TeamOrder(mission.leading, mission.formation)
        self._proposed: TeamOrder | None = None
        """Newest order of an operator that no leader has been heard to carry out."""
        self._repeat_at = float("-inf")
        self._window = TermWindow()
        """Versions that are believed, as terms are (E26): one that a robot made up is not the last."""
        self._carried = NO_TERM
        """Term under which this robot heard the order last, or carries it itself."""
        self._reminded = NO_TERM
        """Newest known term; its leader is told of the order at `_repeat_at` unless it says it."""

    def propose(self, order: TeamOrder, leads: bool, term: Term, now: float) -> bool:
        """Process an operator's order: as leader, carry it out or say why not. Return True if the mission changes."""
        if not self._window.believes(order.version, now):
            return False
        if not leads:
            if self._proposed is None or order.version > self._proposed.version:
                self._proposed = order
            return False
        if order == self.order:
            self._say(term, now)
            return False
        if order.version <= self.order.version:
            self._refuse(order, f"version {self.order.version} holds already", term, now)
            return False
        try:
            self._adopt(order, term)
        except Refused as refused:
            self._refuse(order, str(refused), term, now)
            return False
        self._say(term, now)
        return True

    def hear(self, note: OrderNote, newest: Term, now: float) -> bool:
        """Process what a leader carries; `newest` is the newest known term. Return True if the mission changes."""
        order, term = note.order, note.term
        if term is None or term < newest or order.version == 0 or not self._window.believes(order.version, now):
            return False
        if (order.version, term) <= (self.order.version, self._carried):
            return False
        if order == self.order:
            self._carried = term
            return False
        try:
            self._adopt(order, term)
        except Refused:
            return False
        self._outbox.event("order", now, term, {"version": order.version})
        return True

    def hear_robot(self, note: OrderNote, term: Term, now: float) -> bool:
        """Process, as leader of `term`, an order that another robot knows. Return True if the mission changes."""
        return note.order.version > self.order.version and self.propose(note.order, True, term, now)

    def begin(self, term: Term, now: float) -> bool:
        """Start a term as leader, with the newest order. Return True if the mission changes."""
        self._repeat_at, self._carried = now, term
        proposed, self._proposed = self._proposed, None
        newer = proposed is not None and proposed.version > self.order.version
        return proposed is not None and newer and self.propose(proposed, True, term, now)

    def lead(self, term: Term, now: float) -> None:
        """Say the order again once in a while, for those that have missed it."""
        if self.order.version > 0 and now >= self._repeat_at:
            self.say(term, now)

    def follow(self, newest: Term, now: float) -> None:
        """Tell a leader that does not say this robot's order of it; `newest` is the newest known term."""
        if self.order.version == 0 or self._carried >= newest:
            return
        if self._reminded != newest:
            self._reminded, self._repeat_at = newest, now + REMIND_S
        elif now >= self._repeat_at:
            self.say(self._carried, now)

    def say(self, term: Term, now: float) -> None:
        """Publish the order as the leader of `term` carries it, or carried it."""
        self._repeat_at = now + REPEAT_S
        self._outbox.publish("team_order", OrderNote(self._outbox.header("team_order", now), self.order, term))

    def _adopt(self, order: TeamOrder, term: Term) -> None:
        self.mission = check_mission(structs.replace(self.mission, leading=order.leading, formation=order.formation))
        self.order, self._carried = order, term

    def _say(self, term: Term, now: float) -> None:
        self.say(term, now)
        self._outbox.event("order", now, term, {"version": self.order.version, "by": "leader"})

    def _refuse(self, order: TeamOrder, reason: str, term: Term, now: float) -> None:
        self._outbox.event("order_refused", now, term, {"version": order.version, "reason": reason})
