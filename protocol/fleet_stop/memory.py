"""What one agent knows of the fleet stop: the memory from which its gateway learns after a restart (E30).

An agent hears the orders as the gateways do. One that starts knows nothing: its own gateway tells it, if that has run
on; otherwise it asks the other agents, and is certain when more than half of the team has answered, itself included, or
all of the chain that the voters have agreed on: a team that begins without some of its robots need not wait for them.
"""

from __future__ import annotations

from collections.abc import Iterable

from lfa.protocol.messages.stop import NO_STOP, StopKnowledge, StopOrder, StopWord

ASK_S = 0.1
"""Time [s] between two requests of an agent that is not certain."""


class StopMemory:
    """Knowledge of the agent of `robot_id` in a team of `robots`."""

    def __init__(self, robot_id: int, robots: Iterable[int]) -> None:
        self._robots = set(robots)
        self._heard = {robot_id}
        self._chain: set[int] = set()
        self._word: StopWord = NO_STOP
        self._ask_at = float("-inf")
        self.certain = len(self._robots) == 1
        """True once no word from before this agent's start can be unknown to it."""

    @property
    def known(self) -> StopKnowledge:
        """Newest word, and whether it is certain."""
        return StopKnowledge(self._word, self.certain)

    @property
    def stands(self) -> bool:
        """True if the newest word is a stop."""
        return self._word.stand

    @property
    def robots(self) -> tuple[int, ...]:
        """Robots of the team: those of the mission, less those declared lost, and those of the chain."""
        return tuple(sorted(self._robots | self._chain))

    def order(self, order: StopOrder) -> None:
        """Update with an operator's order."""
        if order.word is not None:
            self._adopt(order.word)

    def hear_gateway(self, known: StopKnowledge) -> None:
        """Update with what the own gateway knows."""
        self._adopt(known.word)
        self.certain = self.certain or known.certain

    def hear_agent(self, robot: int, known: StopKnowledge) -> None:
        """Update with the answer of another robot's agent, while this one is not certain."""
        if not self.certain and robot in self._robots:
            self._adopt(known.word)
            self._heard.add(robot)
            self._decide()

    def hear_chain(self, robots: Iterable[int]) -> None:
        """Update with the chain that a majority of the voters has agreed on."""
        self._chain = set(robots)
        self._decide()

    def forget(self, robots: Iterable[int]) -> None:
        """Ask no more for the answers of robots that an operator declared lost for good (E20)."""
        self._robots -= set(robots) - self._heard
        self._decide()

    def ask_due(self, now: float) -> bool:
        """Return True if the other agents are to be asked now."""
        if self.certain or now < self._ask_at:
            return False
        self._ask_at = now + ASK_S
        return True

    def _decide(self) -> None:
        enough = 2 * len(self._heard) > len(self._robots)
        self.certain = self.certain or enough or (bool(self._chain) and self._chain <= self._heard)

    def _adopt(self, word: StopWord) -> None:
        self._word = max(self._word, word)
