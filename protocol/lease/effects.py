"""Effects that a `Lease` returns: plain data, to be carried out in order by its caller."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from lfa.protocol.messages.consensus import Config, Hello, LeaseBody, Term
from lfa.protocol.topics import TO_ALL, TO_HELLO

Cause = Literal["expired", "released", "deposed", "handed_over"]


class Send(Struct, frozen=True):
    """Order to publish `body`. `to` is `all`, `robot2`, `witness`, or `gateway2`: robot 2's gateway (in its driver)."""

    to: str
    body: LeaseBody

    @property
    def receiver(self) -> str:
        """Receiver's part of the key of the topic `lease`."""
        return TO_HELLO if isinstance(self.body, Hello) and self.to == TO_ALL else self.to


class BecomeLeader(Struct, frozen=True):
    """Notice that a quorum granted `term` to this process until `expiry`, its own monotonic time [s].

    Repeated with a higher term when a leader had to raise its own, without a StepDown in between.
    """

    term: Term
    expiry: float


class LeaseExtended(Struct, frozen=True):
    """Notice that a quorum granted `term` anew, until `expiry`, the own monotonic time [s]."""

    term: Term
    expiry: float


class StepDown(Struct, frozen=True):
    """Order to send no further command under `term`."""

    term: Term
    cause: Cause


class AdoptChain(Struct, frozen=True):
    """Notice of a newer config; `config.chain[0]` leads."""

    config: Config


class StandAside(Struct, frozen=True):
    """Order to end for good: the team holds another agreement (E25); `reason` says in one line what differs."""

    reason: str


Effect = Send | BecomeLeader | LeaseExtended | StepDown | AdoptChain | StandAside
