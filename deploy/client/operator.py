"""Messages of the operator on its own topics: events about the run and its faults, and commands to the fleet."""

from __future__ import annotations

from typing import Any

from lfa.protocol.messages.consensus import Member
from lfa.protocol.messages.orders import OrderNote, TeamOrder
from lfa.protocol.messages.stop import StopOrder, StopWord
from lfa.protocol.messages.team import Ask, OperatorNote
from lfa.protocol.node import Envelope
from lfa.protocol.outbox import Outbox
from lfa.protocol.topics import OPERATOR_NAME


class Operator:
    """Source of one operator's events, commands and requests; `now` is its own clock [s]."""

    def __init__(self, fleet: str, incarnation: int) -> None:
        self._outbox = Outbox(fleet, OPERATOR_NAME, incarnation, first=1)
        self.event_key = self._outbox.key("event")

    def event(self, kind: str, now: float, **data: Any) -> Envelope:
        return self._outbox.event_envelope(kind, now, None, data)

    def command(self, command: str, now: float, **arguments: Any) -> Envelope:
        return self._outbox.envelope("operator", OperatorNote(self._outbox.header("operator", now), command, arguments))

    def stop(self, word: StopWord | None, gateways: tuple[Member, ...], now: float) -> Envelope:
        """Return an order to all gateways to stand or to go; without a `word` it only asks."""
        return self._outbox.envelope("stop", StopOrder(self._outbox.header("stop", now), word, gateways))

    def order(self, order: TeamOrder, now: float) -> Envelope:
        """Return a change of the mission, for the leader to carry out."""
        return self._outbox.envelope("team_order", OrderNote(self._outbox.header("team_order", now), order))

    def ask(self, what: str, now: float) -> Envelope:
        """Return a request to publish `what`, such as the mission."""
        return self._outbox.envelope("ask", Ask(self._outbox.header("ask", now), what))
