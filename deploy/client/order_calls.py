"""Changes of a team's mission, one at a time, said until the team has decided on them (E32). Pure."""

from __future__ import annotations

from collections.abc import Callable

from lfa.agents.orders.team_orders import QUESTION
from lfa.deploy.client.operator import Operator
from lfa.deploy.client.order_call import Change, OrderCall
from lfa.protocol.errors import Refused
from lfa.protocol.messages.orders import OrderNote
from lfa.protocol.messages.team import Event
from lfa.protocol.mission import Mission
from lfa.protocol.node import Envelope

ASK_S = 0.2
"""Period [s] of asking for the mission and for the order that holds, until both are known."""

Publish = Callable[[Envelope], None]
Tell = Callable[[bool, str], None]
"""Receives whether a change is carried out, and a sentence about it."""


class OrderCalls:
    """The change that is being said, and who is told what became of it."""

    def __init__(self, operator: Operator, publish: Publish, mission: Mission | None = None) -> None:
        """`mission` is that with which the team began; None: it is asked for."""
        self._operator = operator
        self._publish = publish
        self._mission = mission
        self._running: tuple[OrderCall, Tell] | None = None
        self._ask_at = 0.0

    @property
    def running(self) -> bool:
        """True while a change is said that is not decided yet."""
        return self._running is not None

    def begin(self, change: Change, paused: bool | None, now: float, tell: Tell) -> None:
        """Say a change; one that is not decided yet ends. `paused`: whether the leader then stands; None: as before."""
        self._end(False, "another order came in the meantime")
        self._running, self._ask_at = (OrderCall(change, paused, now), tell), now
        if self._mission is not None:
            self._running[0].hear_mission(self._mission)

    def hear_mission(self, mission: Mission) -> None:
        """Take the mission with which the team began."""
        self._mission = self._mission or mission
        if self._running is not None:
            self._running[0].hear_mission(mission)

    def hear(self, message: OrderNote | Event) -> None:
        """Take what a robot says of an order."""
        if self._running is None:
            return
        try:
            self._running[0].hear(message)
        except Refused as refused:
            self._end(False, str(refused))

    def step(self, now: float) -> None:
        """Say the order again where it is due; tell when it is carried out, refused, or not answered in time."""
        if self._running is None:
            return
        call, _ = self._running
        try:
            order = call.said(now)
        except Refused as refused:
            self._end(False, str(refused))
            return
        if order is not None:
            self._publish(self._operator.order(order, now))
        elif now >= self._ask_at:
            self._ask_at = now + ASK_S
            if self._mission is None:
                self._publish(self._operator.ask("mission", now))
            self._publish(self._operator.ask(QUESTION, now))
        outcome = call.outcome(now)
        if outcome is None:
            return
        if outcome.leader is None:
            self._end(False, "no leader has answered")
        elif outcome.reason:
            self._end(False, f"robot {outcome.leader} refuses it: {outcome.reason}")
        else:
            known = f"{len(outcome.robots)} robots know it"
            self._end(True, f"order {outcome.version} carried out by robot {outcome.leader}, {known}")

    def _end(self, success: bool, text: str) -> None:
        running, self._running = self._running, None
        if running is not None:
            running[1](success, text)
