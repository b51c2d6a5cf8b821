"""A stop or resume as a Node, for simulations: in a session, `stop_fleet.py` runs the same `StopCall`."""

from __future__ import annotations

from math import inf
from typing import Any

from lfa.deploy.client.operator import Operator
from lfa.deploy.client.stop_call import StopCall, StopOutcome
from lfa.protocol.errors import Refused
from lfa.protocol.messages.stop import StopState
from lfa.protocol.names import robot_id_of
from lfa.protocol.node import Envelope, Received
from lfa.protocol.topics import address, key

PERIOD_S = 0.01


class StopNode:
    """Operator who says stop (`stand`) or resume to the `robots` of a fleet, once; `outcome` is None until the end."""

    defer_hellos = defer_grants = False

    def __init__(self, fleet: str, name: str, incarnation: int, robots: tuple[int, ...], *, stand: bool) -> None:
        """Create a node; `name` is that of its process in the simulation, its messages are the operator's."""
        self.name = name
        self.incarnation = incarnation
        self.finished = False
        self.refusal: str | None = None
        self.started_with: dict[str, Any] = {"kind": "operator", "stand": stand}
        self.interests = frozenset({key(fleet, "*", "stop_state")})
        self.outcome: StopOutcome | None = None
        self.refused: str | None = None
        """Reason why a resume had no effect."""
        self._operator = Operator(fleet, incarnation)
        self._robots = robots
        self._stand = stand
        self._call: StopCall | None = None
        self._next = -inf

    def next_deadline(self) -> float:
        return inf if self.finished else self._next

    def receive(self, received: Received) -> list[Envelope]:
        """Process the answer of a gateway."""
        where = address(received.key)
        robot = None if where is None else robot_id_of(where.owner)
        if isinstance(received.message, StopState) and robot is not None and self._call is not None:
            self._call.hear(robot, received.message, received.at)
        return self._said(received.at)

    def tick(self, now: float) -> list[Envelope]:
        """Say what is due."""
        self._next = now + PERIOD_S
        if self._call is None:
            self._call = StopCall(self._stand, now)
            self._call.name(self._robots)
        return self._said(now)

    def _said(self, now: float) -> list[Envelope]:
        if self._call is None or self.finished:
            return []
        try:
            said = self._call.said(now)
        except Refused as refused:
            self.refused, self.finished = str(refused), True
            return []
        self.outcome = self._call.outcome(now)
        self.finished = self.outcome is not None
        return [] if said is None else [self._operator.stop(said.word, said.gateways, now)]
