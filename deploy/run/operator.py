"""What the operator's side says on its own topic: that a run starts and ends, and what was done to whom."""

from __future__ import annotations

from typing import Any

from protocol.messages import Event, Header
from protocol.topics import OPERATOR_NAME, key


class Operator:
    """Numbers the events of one operator; `stamp` is its own clock [s]."""

    def __init__(self, fleet: str, incarnation: int) -> None:
        self.key = key(fleet, OPERATOR_NAME, "event")
        self._incarnation = incarnation
        self._seq = 0

    def says(self, kind: str, stamp: float, **data: Any) -> Event:
        self._seq += 1
        header = Header(OPERATOR_NAME, self._incarnation, self._seq, stamp)
        return Event(header, kind, None, data)
