"""What a `Lease` wants done: plain data, to be carried out in order by whoever runs it."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from lfa.protocol.messages.consensus import Config, LeaseBody, Term

Cause = Literal["expired", "released", "deposed", "handed_over"]


class Send(Struct, frozen=True):
    """Publish `body`. `to` is `all`, `robot2`, `witness`, or `gateway2`: the gateway of robot 2 (its driver's)."""

    to: str
    body: LeaseBody


class BecomeLeader(Struct, frozen=True):
    """A quorum granted `term` to this process until `expiry`, its own monotonic time [s].

    Comes again with a higher term when a leader had to raise its own; there is no StepDown between.
    """

    term: Term
    expiry: float


class LeaseExtended(Struct, frozen=True):
    term: Term
    expiry: float


class StepDown(Struct, frozen=True):
    """Command no more under `term`."""

    term: Term
    cause: Cause


class AdoptChain(Struct, frozen=True):
    """A newer config than the last one; `config.chain[0]` leads."""

    config: Config


Effect = Send | BecomeLeader | LeaseExtended | StepDown | AdoptChain
