"""The fleet stop at one gateway: no wheel turns while the newest word is a stop, or before the gateway may know (E28).

A gateway forgets everything when it restarts. So it begins uncertain, and stands: until its agent, which heard the
orders too, tells it what holds; or until an operator says a word that names this incarnation (E30).
"""

from __future__ import annotations

from math import inf

from lfa.protocol.messages.header import Header
from lfa.protocol.messages.stop import NO_STOP, StopKnowledge, StopOrder, StopWord

OPERATORS_MAX = 32
"""Number of operators whose last order is known; the one silent for longest is forgotten."""


class StopLatch:
    """Latch of the gateway of robot `robot_id`; `now` is the gateway's own time [s]."""

    def __init__(self, robot_id: int, incarnation: int, operator_timeout_s: float | None = None) -> None:
        """Create a latch that holds; `operator_timeout_s`: silence [s] of all operators after which it holds."""
        self._robot_id = robot_id
        self._incarnation = incarnation
        self._operator_timeout_s = operator_timeout_s
        self._word: StopWord = NO_STOP
        self._certain = False
        self._agent_word: StopWord | None = None
        """Word in the agent's last command."""
        self._operator_at = -inf
        self._heard: dict[int, int] = {}
        """Number of the last order of each operator, by its incarnation, the latest heard last."""

    @property
    def known(self) -> StopKnowledge:
        """Newest word, and whether it is certain that there is none newer from before this gateway's start."""
        return StopKnowledge(self._word, self._certain)

    @property
    def kept(self) -> bool:
        """True if the agent knows this latch's word: a restart of the gateway alone does not lose it then."""
        return self._agent_word is not None and self._agent_word >= self._word

    def holds(self, now: float) -> bool:
        """Return True if the wheels must stand: stopped, not certain yet, or without contact to an operator (E31)."""
        timeout_s = self._operator_timeout_s
        return self._word.stand or not self._certain or (timeout_s is not None and now - self._operator_at > timeout_s)

    def order(self, order: StopOrder, now: float) -> None:
        """Adopt the word of an order unless a greater one is known: late and replayed orders are void (E29)."""
        if self._is_new(order.header):
            self._operator_at = now
        word = order.word
        if word is None or word < self._word:
            return
        self._word = word
        self._certain = self._certain or any(
            gateway.id == self._robot_id and gateway.incarnation == self._incarnation for gateway in order.gateways
        )

    def hear_agent(self, known: StopKnowledge) -> None:
        """Update with the knowledge of the robot's own agent, from a command fresh by this gateway's clock (E30).

        It may stop a certain gateway, which has missed an order, but lets only an uncertain one go.
        """
        self._agent_word = known.word
        if known.word > self._word and (known.word.stand or not self._certain):
            self._word = known.word
        self._certain = self._certain or known.certain

    def _is_new(self, header: Header) -> bool:
        """Return True for the newest order of its operator so far: a replayed one is no sign of contact."""
        last = self._heard.pop(header.incarnation, -1)
        self._heard[header.incarnation] = max(last, header.seq)
        if len(self._heard) > OPERATORS_MAX:
            del self._heard[next(iter(self._heard))]
        return header.seq > last
