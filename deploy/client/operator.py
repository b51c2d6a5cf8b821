"""Messages of the operator on its own topics: events about the run and its faults, and commands to the fleet."""

from __future__ import annotations

from typing import Any

from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Event, OperatorNote
from lfa.protocol.topics import OPERATOR_NAME, key


class Operator:
    """Source of one operator's events and commands, with sequence numbers; `stamp` is its own clock [s]."""

    def __init__(self, fleet: str, incarnation: int) -> None:
        self.key = key(fleet, OPERATOR_NAME, "event")
        self.orders_key = key(fleet, OPERATOR_NAME, "operator")
        self._incarnation = incarnation
        self._seq = 0

    def says(self, kind: str, stamp: float, **data: Any) -> Event:
        return Event(self._header(stamp), kind, None, data)

    def orders(self, command: str, stamp: float, **arguments: Any) -> OperatorNote:
        return OperatorNote(self._header(stamp), command, arguments)

    def _header(self, stamp: float) -> Header:
        self._seq += 1
        return Header(OPERATOR_NAME, self._incarnation, self._seq, stamp)
