"""Inward half of the bridge: orders of ROS users, each parsed, checked and passed on as an operator's message."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lfa.agents.formation.formation import named
from lfa.deploy.ros.session import NodeHandle, ServiceCall
from lfa.deploy.ros.types import kind
from lfa.protocol.errors import Refused
from lfa.protocol.mission import FormationSpec

HANDOVER_S_MAX = 5.0
"""Time [s] within which another robot must lead after a hand-over was asked for."""
WORDS_MAX = 80
"""Number of characters of a foreign text that are repeated in a log line."""

Order = Callable[..., None]
"""Sends an operator's command, by its name and its arguments."""


class OperatorInput:
    """Topics and services for operators: `/lfa/formation/set` (String) and `/lfa/handover` (Trigger)."""

    def __init__(self, node: NodeHandle, order: Order, warn: Callable[[str], None]) -> None:
        self._order = order
        self._warn = warn
        self._formation = node.subscription("/lfa/formation/set", "std_msgs/msg/String")
        self._handover = node.service("/lfa/handover", "std_srvs/srv/Trigger")
        self._waiting: list[tuple[float, int, ServiceCall]] = []
        """Calls of the hand-over: deadline [s], the leader then, and the call."""

    def step(self, leader: int, now: float) -> None:
        """Obey what came in; answer the calls that are decided. `leader`: 0 for none."""
        for message in self._formation.take():
            self._change_formation(message.data)
        for call in self._handover.take():
            if not leader:
                _answer(call, success=False, text="nobody leads at the moment")
                continue
            self._order("handover")
            self._waiting.append((now + HANDOVER_S_MAX, leader, call))
        undecided = []
        for deadline, before, call in self._waiting:
            if leader not in (0, before):
                _answer(call, success=True, text=f"robot {leader} leads")
            elif now > deadline:
                _answer(call, success=False, text=f"robot {before} still leads after {HANDOVER_S_MAX:g} s")
            else:
                undecided.append((deadline, before, call))
        self._waiting = undecided

    def _change_formation(self, side: str) -> None:
        try:
            named(side, FormationSpec())
        except Refused as refused:
            self._warn(f"/lfa/formation/set: {refused}"[:WORDS_MAX])
            return
        self._order("formation", side=side)


def _answer(call: ServiceCall, *, success: bool, text: str) -> None:
    response: Any = kind("std_srvs/msg/Trigger_Response")(success=success, message=text)
    call.answer(response)
