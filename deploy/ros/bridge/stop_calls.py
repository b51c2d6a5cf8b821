"""Calls of the services `/lfa/stop` and `/lfa/resume`: each is said to all gateways until they have answered (E29)."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from lfa.deploy.client.stop_call import Said, StopCall
from lfa.deploy.client.stop_fleet import outcome_lines
from lfa.deploy.ros.bridge.answers import answer
from lfa.deploy.ros.session import ServiceCall
from lfa.protocol.errors import Refused
from lfa.protocol.messages.stop import StopState

STOP, RESUME = "/lfa/stop", "/lfa/resume"

Say = Callable[[Said, float], None]
"""Publishes an order to the gateways, at a time [s]."""


class StopCalls:
    """The stop or resume that is being said, and the service calls that wait for its outcome."""

    def __init__(self, say: Say) -> None:
        self._say = say
        self._stand = True
        self._running: StopCall | None = None
        self._waiting: list[ServiceCall] = []

    def ask(self, call: ServiceCall, robots: Iterable[int], now: float, *, stand: bool) -> None:
        """Begin to say stop (`stand`) or resume to `robots`; the other word, if it is being said, ends."""
        if self._running is None or stand != self._stand:
            self._end(success=False, text=f"{'stop' if stand else 'resume'} was called in the meantime")
            self._stand, self._running = stand, StopCall(stand, now)
            self._running.name(tuple(robots))
        self._waiting.append(call)

    def hear(self, robot: int, state: StopState, now: float) -> None:
        """Take the answer of a robot's gateway."""
        if self._running is not None:
            self._running.hear(robot, state, now)

    def step(self, now: float) -> None:
        """Say the word again where it is due; answer the calls when all robots have done as told, or are named."""
        if self._running is None:
            return
        try:
            said = self._running.said(now)
        except Refused as refused:
            self._end(success=False, text=str(refused))
            return
        if said is not None:
            self._say(said, now)
        outcome = self._running.outcome(now)
        if outcome is not None:
            self._end(success=outcome.complete, text="; ".join(outcome_lines(outcome, stand=self._stand)))

    def _end(self, *, success: bool, text: str) -> None:
        waiting, self._waiting, self._running = self._waiting, [], None
        for call in waiting:
            answer(call, success=success, text=text)
