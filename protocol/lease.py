"""The lease of one process: who leads, for how long, with whom behind it. Rules E1.. are in protocol/README.md."""

from __future__ import annotations

from msgspec import Struct

from protocol.messages import Config, LeaseBody, Member, Role, Term
from protocol.mission import Mission
from protocol.timing import Timing


class Send(Struct, frozen=True):
    """Publish `body`. `to` is `all`, `robot2`, `witness`, or `gateway2`: the gateway of robot 2 (its driver's)."""

    to: str
    body: LeaseBody


class BecomeLeader(Struct, frozen=True):
    """A quorum granted `term` to this process until `expiry`, its own monotonic time [s]."""

    term: Term
    expiry: float


class LeaseExtended(Struct, frozen=True):
    term: Term
    expiry: float


class StepDown(Struct, frozen=True):
    """Command no more under `term`: expired, released, deposed, handed_over."""

    term: Term
    cause: str


class AdoptChain(Struct, frozen=True):
    """A newer config than the last one; `config.chain[0]` leads."""

    config: Config


Effect = Send | BecomeLeader | LeaseExtended | StepDown | AdoptChain


class Lease:
    """Voter, candidate and leader of one process. No clock, no socket: time comes in, effects go out, in order."""

    config: Config
    term: Term
    """Of the lease that this process holds, or of the config that it obeys."""
    leader: int | None
    """Id of the holder of `term` as far as known; None when its lease has run out as seen from here."""
    chain: tuple[int, ...]
    """Ids of `config.chain`, leader first."""
    role: Role
    released: bool
    """A requested release is complete: the last words are out and the process may end."""

    def __init__(self, me: Member, mission: Mission, timing: Timing, now: float, floor: int) -> None:
        """The lease of `me` (id 0: the witness, which votes and never leads) at its start.

        `floor` is the wall clock's milliseconds at boot (small integers in simulation): terms of this life start
        above it. It orders lives and is no part of any safety argument.
        """
        raise NotImplementedError

    def receive(self, src: Member, body: LeaseBody, now: float) -> list[Effect]:
        """A message of another process, or of this one's own gateway (FENCED: `src.id` is the gateway's robot)."""
        raise NotImplementedError

    def tick(self, now: float) -> list[Effect]:
        """A deadline passed."""
        raise NotImplementedError

    def next_deadline(self) -> float:
        """When to tick next."""
        raise NotImplementedError

    def hint(self, id: int, incarnation: int, up: bool, now: float) -> list[Effect]:
        """A liveliness token came (up) or went: never a proof."""
        raise NotImplementedError

    def gateway_term(self, term: Term, now: float, latched: bool = False) -> list[Effect]:
        """What this robot's own gateway says in `sensors`: its highest term, and whether it is latched there."""
        raise NotImplementedError

    def commanded(self, now: float) -> None:
        """A command as leader was just sent."""
        raise NotImplementedError

    def may_command(self, now: float) -> bool:
        """Leading, and `now` is before the lease's expiry (I1, I2)."""
        raise NotImplementedError

    def request_release(self, now: float) -> list[Effect]:
        """Clean exit: stop leading, tell the voters; `released` turns true, at once when there is nothing to give up."""
        raise NotImplementedError

    def request_handover(self, now: float) -> list[Effect]:
        """The leader is stuck: give the lease to the next in the chain that answers."""
        raise NotImplementedError
