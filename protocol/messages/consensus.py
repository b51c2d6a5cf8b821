"""Messages and values of the lease protocol: terms, members, configs (lease.md 3.1, 3.3)."""

from __future__ import annotations

from enum import StrEnum

import msgspec
from msgspec import Struct

from lfa.protocol.geometry import Number
from lfa.protocol.messages.header import Count, Header, Stamp


class Term(Struct, frozen=True, array_like=True, order=True, gc=False):
    """An election epoch, totally ordered and never used twice: number, issuer's id and issuer's incarnation."""

    n: Count = 0
    issuer: Count = 0
    incarnation: Count = 0


NO_TERM = Term()


class Member(Struct, frozen=True, array_like=True, order=True, gc=False):
    """One life of one id. Id 0 is the witness: a voter without a robot."""

    id: Count
    incarnation: Count


class Version(Struct, frozen=True, array_like=True, order=True, gc=False):
    """Of a config: the term whose holder wrote it, and a number within that term."""

    term: Term = NO_TERM
    seq: Count = 0


class Electorate(Struct, frozen=True, array_like=True):
    """A set of voters and its tie-breaker: the previous one counts too while a change is joint."""

    voters: tuple[Member, ...]
    tie: Member | None = None
    rule: str = "half"
    """`half` (majority, or one half with the tie-breaker) or `all` (after a full house, lease.md 3.9)."""


class Config(Struct, frozen=True, array_like=True):
    """The one versioned record of a term: who votes and who follows whom. `chain[0]` leads."""

    version: Version
    voters: tuple[Member, ...]
    tie: Member | None
    previous: Electorate | None
    chain: tuple[Member, ...]


class GatewayStamp(Struct, frozen=True, array_like=True, gc=False):
    """A moment of a gateway's own clock, echoed in commands so that their age is judged on one clock only."""

    incarnation: Count
    time: Stamp


class Prepare(Struct, frozen=True, array_like=True, tag="prepare"):
    term: Term
    version: Version
    forget: tuple[Member, ...] = ()
    """Lives that an operator declared dead for this attempt only, and with them every earlier one of their ids."""


class Grantee(Struct, frozen=True, array_like=True):
    """Whom a voter is still bound to: the exact term, its holder and the holder's incarnation."""

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


class Propose(Struct, frozen=True, array_like=True, tag="propose"):
    """Lease request, renewal, config write and hand-over: the heartbeat."""

    term: Term
    config: Config
    round: Count
    holder: Member
    fenced: tuple[Term, ...] = ()
    nonce: Stamp | None = None


class Grant(Struct, frozen=True, array_like=True, tag="grant"):
    term: Term
    round: Count
    version: Version
    nonce: Stamp


class Release(Struct, frozen=True, array_like=True, tag="release"):
    """The holder's own gateway refuses every term up to `term`, or its residual motion has run out."""

    term: Term


class Hello(Struct, frozen=True, array_like=True, tag="hello"):
    """From anyone who holds no live grant; `version` is None for a blank process."""

    version: Version | None


HELLO_MARK, GRANT_MARK = (msgspec.msgpack.encode(kind.__struct_config__.tag) for kind in (Hello, Grant))
"""Among the bytes of every note that holds one."""


class Fence(Struct, frozen=True, array_like=True, tag="fence"):
    """To the gateway of the robot whose term `old` is to end: refuse everything below `term`."""

    old: Term
    term: Term


class Fenced(Struct, frozen=True, array_like=True, tag="fenced"):
    """From that gateway: `old` can act no more here; nothing below `term` will."""

    old: Term
    term: Term


LeaseBody = Prepare | Promise | Nack | Propose | Grant | Release | Hello | Fence | Fenced


class LeaseNote(Struct, frozen=True, array_like=True, tag="lease"):
    header: Header
    body: LeaseBody


class Role(StrEnum):
    LEADER = "leader"
    FOLLOWER = "follower"
    WAITING = "waiting"
