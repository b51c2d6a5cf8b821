"""Agent whose commands carry the twist of a policy: it votes, may lead and reports as always.

The twist is replaced in `cmd_vel`, between the agent and its gateway: the lease, the gateway's checks, the deadman and
the drive's limits stay in force. The agent's own avoidance does not: that is for the policy to learn.
"""

from __future__ import annotations

from msgspec import structs

from lfa.agents.agent import Agent
from lfa.protocol.geometry import Twist
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.node import Envelope, Received


class CommandedAgent(Agent):
    """Agent that drives by its own behaviour while `wanted` is None."""

    wanted: Twist | None = None
    """Twist that the policy commands, held until it is changed."""

    def receive(self, received: Received) -> list[Envelope]:
        return self._commanded(super().receive(received))

    def tick(self, now: float) -> list[Envelope]:
        return self._commanded(super().tick(now))

    def _commanded(self, envelopes: list[Envelope]) -> list[Envelope]:
        wanted = self.wanted
        return envelopes if wanted is None else [_replaced(envelope, wanted) for envelope in envelopes]


def _replaced(envelope: Envelope, wanted: Twist) -> Envelope:
    message = envelope.message
    if not isinstance(message, CmdVel):
        return envelope
    return Envelope(envelope.key, structs.replace(message, twist=wanted))
