"""Messages of the fleet stop: orders of an operator to stand or to go, and what gateways and agents know of them.

They need no leader and no quorum: each gateway obeys for itself (E28 to E31).
"""

from __future__ import annotations

from msgspec import Struct

from lfa.protocol.messages.consensus import Member
from lfa.protocol.messages.header import Count, Header

EPOCH_MAX = 2**53
"""Largest epoch, the largest number of a message: an operator counts up by one for each word."""
EPOCH_FREE = 2**43
"""Epoch up to which an operator believes a single gateway: so many words nobody says. A greater one, which a robot made
up, counts once more than half of the gateways tell one about as great (E29)."""


class StopWord(Struct, frozen=True, array_like=True, order=True, gc=False):
    """Order to stand (`stand`) or to go. The greater of two holds: the later epoch, and at one epoch the stop."""

    epoch: Count = 0
    stand: bool = False


NO_STOP = StopWord()
"""Word of a fleet that nobody has stopped yet: all may go."""


class StopKnowledge(Struct, frozen=True, array_like=True, gc=False):
    """Newest word that a gateway or an agent knows."""

    word: StopWord = NO_STOP
    certain: bool = False
    """False from the start until others or the operator have confirmed that no newer word was given before (E30)."""


UNCERTAIN, NEVER_STOPPED = StopKnowledge(), StopKnowledge(certain=True)


class StopOrder(Struct, frozen=True, array_like=True, tag="stop"):
    """Word of an operator to all gateways, repeated until each has answered with `StopState`."""

    header: Header
    word: StopWord | None
    """None: the operator only asks, and shows that it is there (`Mission.operator_timeout_s`)."""
    gateways: tuple[Member, ...] = ()
    """Gateways whose answers the operator has received, by robot and incarnation: a gateway that finds itself here
    knows that the order is from after its start."""


class StopState(Struct, frozen=True, array_like=True, tag="stop_state"):
    """Answer of a gateway to each `StopOrder`; also sent once when the wheels of a stopped robot have come to rest."""

    header: Header
    known: StopKnowledge
    at_rest: bool
    kept: bool
    """True if the robot's agent knows this word too, so that a restart of the gateway alone does not lose it."""


class StopReport(Struct, frozen=True, array_like=True, tag="stop_known"):
    """Answer of an agent to who asks `stop`: an agent that has started, or an operator who says stop or resume."""

    header: Header
    known: StopKnowledge
    robots: tuple[Count, ...] = ()
    """Robots of the team, as far as the agent knows; empty from one that does not tell."""
