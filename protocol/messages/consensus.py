"""Messages and values of the lease protocol: terms, members, configs (lease.md 3.1, 3.3)."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from msgspec import Meta, Struct

from lfa.protocol.geometry import Number
from lfa.protocol.messages.header import UNSAID_WIRE, Count, Header, Stamp
from lfa.protocol.mission import ColdStart, Lonely, Profile, Shrink, TieBreak


class Term(Struct, frozen=True, array_like=True, order=True, gc=False):
    """Election epoch, totally ordered and never used twice: number, issuer's id and issuer's incarnation."""

    n: Count = 0
    issuer: Count = 0
    incarnation: Count = 0


NO_TERM = Term()


class Member(Struct, frozen=True, array_like=True, order=True, gc=False):
    """One incarnation of one id. Id 0 is the witness: a voter without a robot."""

    id: Count
    incarnation: Count


class Version(Struct, frozen=True, array_like=True, order=True, gc=False):
    """Version of a config: the term whose holder wrote it, and a number within that term."""

    term: Term = NO_TERM
    seq: Count = 0


class Electorate(Struct, frozen=True, array_like=True):
    """Set of voters and its tie-breaker. While a change is joint, the previous electorate must agree too."""

    voters: tuple[Member, ...]
    tie: Member | None = None
    rule: str = "half"
    """Quorum rule: `half` (majority, or one half with the tie-breaker) or `all` (unanimous start, lease.md 3.9)."""


class Spare(Struct, frozen=True, array_like=True, order=True, gc=False):
    """Robot that the mission does not name, and that an operator has admitted (E33)."""

    id: Count
    slot_of: Count = 0
    """Robot of the mission whose place in the chain it takes, when that one is not there; 0: the tail."""


class Roster(Struct, frozen=True, array_like=True):
    """What operators have changed of the mission's robots (E33, E34). A spare that is retired remains a spare."""

    spares: tuple[Spare, ...] = ()
    retired: tuple[Count, ...] = ()


NO_CHANGE = Roster()


class Config(Struct, frozen=True, array_like=True):
    """Versioned record of voters, chain and roster, written by the holder of a term. `chain[0]` leads."""

    version: Version
    voters: tuple[Member, ...]
    tie: Member | None
    previous: Electorate | None
    chain: Annotated[tuple[Member, ...], Meta(min_length=1)]
    roster: Roster = NO_CHANGE


class GatewayStamp(Struct, frozen=True, array_like=True, gc=False):
    """Time [s] of a gateway's own clock, echoed in commands so that their age is measured on one clock only."""

    incarnation: Count
    time: Stamp


class Agreement(Struct, frozen=True, array_like=True):
    """What safety rests on and all members must hold alike (E25); by its digest, others are refused."""

    wire: Count
    """Version of the messages."""
    version: Count
    """Version of the mission."""
    robots: tuple[Count, ...]
    witness: bool
    profile: Profile
    act_s: Number
    deadman_s: Number
    clock_rate_error: Number
    can_lead: tuple[Count, ...] | None
    tiebreak: TieBreak
    shrink: Shrink
    cold_start: ColdStart
    lonely: Lonely
    continue_after_s: Number


class Prepare(Struct, frozen=True, array_like=True, tag="prepare"):
    term: Term
    version: Version
    forget: tuple[Member, ...] = ()
    """Incarnations that an operator declared dead for this attempt only, with all earlier ones of their ids (E20)."""
    agreed: Count = 0
    """Digest of the sender's agreement (E25)."""
    wire: Count = UNSAID_WIRE
    """Version of the sender's messages (E35)."""


class Grantee(Struct, frozen=True, array_like=True):
    """Lease that a voter is still bound to: the exact term, its holder and the holder's incarnation."""

    term: Term
    holder: Member


class Promise(Struct, frozen=True, array_like=True, tag="promise"):
    term: Term
    config: Config
    needs_fence: Grantee | None
    blank: bool


class Nack(Struct, frozen=True, array_like=True, tag="nack"):
    term: Term
    promised: Term
    holder: Member | None
    remaining_s: Number
    config: Config
    agreement: Agreement | None = None
    """What the refusing process holds, if that is the reason: it holds something else (E25)."""


class Propose(Struct, frozen=True, array_like=True, tag="propose"):
    """Lease request, renewal, config write and hand-over; it is also the heartbeat."""

    term: Term
    config: Config
    round: Count
    holder: Member
    fenced: tuple[Term, ...] = ()
    nonce: Stamp | None = None
    agreed: Count = 0
    """Digest of the sender's agreement (E25)."""
    wire: Count = UNSAID_WIRE
    """Version of the sender's messages (E35)."""
    grant_ms: Count = 0
    """Bond [ms] that is asked for in this round if it is shorter than `T_grant`; 0: `T_grant` (E36)."""


class Grant(Struct, frozen=True, array_like=True, tag="grant"):
    term: Term
    round: Count
    version: Version
    nonce: Stamp


class Release(Struct, frozen=True, array_like=True, tag="release"):
    """Notice that the holder's own gateway refuses every term up to `term`, or that its residual motion has ended."""

    term: Term


class Hello(Struct, frozen=True, array_like=True, tag="hello"):
    """Request of a process that holds no live grant or is out of the chain (E9); `version` is None if it is blank."""

    version: Version | None
    agreed: Count = 0
    """Digest of the sender's agreement (E25)."""
    wire: Count = UNSAID_WIRE
    """Version of the sender's messages (E35)."""


class Superseded(Struct, frozen=True, array_like=True, tag="superseded"):
    """Answer to the HELLO of an incarnation earlier than `newest`, of which the sender heard or saw the end (E23)."""

    newest: Count


class Fence(Struct, frozen=True, array_like=True, tag="fence"):
    """Order to the gateway of the robot whose term `old` is to end: refuse every term below `term`."""

    old: Term
    term: Term


class Fenced(Struct, frozen=True, array_like=True, tag="fenced"):
    """Answer of that gateway: `old` cannot act here any more, nor any term below `term`."""

    old: Term
    term: Term


LeaseBody = Prepare | Promise | Nack | Propose | Grant | Release | Hello | Superseded | Fence | Fenced


class LeaseNote(Struct, frozen=True, array_like=True, tag="lease"):
    header: Header
    body: LeaseBody


class Role(StrEnum):
    LEADER = "leader"
    FOLLOWER = "follower"
    WAITING = "waiting"
