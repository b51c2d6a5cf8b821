"""Inward half of the bridge: orders of ROS users, each parsed, checked and passed on as an operator's message."""

from __future__ import annotations

from collections.abc import Callable

from lfa.agents.formation.formation import named
from lfa.deploy.ros.bridge.answers import answer
from lfa.deploy.ros.bridge.stop_calls import RESUME, STOP
from lfa.deploy.ros.session import NodeHandle, ServiceCall
from lfa.protocol.errors import Refused
from lfa.protocol.mission import FormationSpec

HANDOVER_S_MAX = 5.0
"""Time [s] within which another robot must lead after a hand-over was asked for."""
WORDS_MAX = 120
"""Number of characters of a line that repeats a foreign text."""

Order = Callable[..., None]
"""Sends an operator's command, by its name and its arguments."""
StopOrder = Callable[..., None]
"""Begins a stop (`stand=True`) or resume of the fleet for a service call, at a time [s]."""


class HandoverCalls:
    """Calls of the hand-over service that wait for another leader."""

    def __init__(self, order: Order) -> None:
        self._order = order
        self._waiting: list[tuple[float, int, ServiceCall]] = []
        """Deadline [s], the leader at the call, and the call."""

    def ask(self, call: ServiceCall, leader: int, now: float) -> None:
        """Order a hand-over; `leader`: 0 for none."""
        if not leader:
            answer(call, success=False, text="nobody leads at the moment")
            return
        self._order("handover")
        self._waiting.append((now + HANDOVER_S_MAX, leader, call))

    def step(self, leader: int, now: float) -> None:
        """Answer the calls that are decided."""
        undecided = []
        for deadline, before, call in self._waiting:
            if leader not in (0, before):
                answer(call, success=True, text=f"robot {leader} leads")
            elif now > deadline:
                answer(call, success=False, text=f"robot {before} still leads after {HANDOVER_S_MAX:g} s")
            else:
                undecided.append((deadline, before, call))
        self._waiting = undecided


class OperatorInput:
    """Topic `/lfa/formation/set` (String), services `/lfa/stop`, `/lfa/resume` and `/lfa/handover` (Trigger)."""

    def __init__(self, node: NodeHandle, order: Order, stop: StopOrder, warn: Callable[[str], None]) -> None:
        self._order = order
        self._stop = stop
        self._warn = warn
        self._formation = node.subscription("/lfa/formation/set", "std_msgs/msg/String")
        self._service = node.service("/lfa/handover", "std_srvs/srv/Trigger")
        self._stops = node.service(STOP, "std_srvs/srv/Trigger")
        self._resumes = node.service(RESUME, "std_srvs/srv/Trigger")
        self._handovers = HandoverCalls(order)

    def step(self, leader: int, now: float) -> None:
        """Obey what came in, a stop first; answer the calls that are decided. `leader`: 0 for none."""
        for call in self._resumes.take():
            self._stop(call, now, stand=False)
        for call in self._stops.take():
            self._stop(call, now, stand=True)
        for message in self._formation.take():
            self._change_formation(message.data)
        for call in self._service.take():
            self._handovers.ask(call, leader, now)
        self._handovers.step(leader, now)

    def _change_formation(self, side: str) -> None:
        try:
            named(side, FormationSpec())
        except Refused as refused:
            self._warn(f"/lfa/formation/set: {refused}"[:WORDS_MAX])
            return
        self._order("formation", side=side)
