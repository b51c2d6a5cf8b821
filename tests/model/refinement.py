"""The project's own rule classes against the models' rules, in every state that they can reach at small sizes.

Each function drives a class of `protocol` and the rule that the models decide with side by side, and raises
AssertionError with what was asked where they differ. It answers how many comparisons it made.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from copy import copy
from itertools import chain, combinations, product
from typing import NamedTuple

from lfa.protocol.geometry import STILL
from lfa.protocol.lease.acceptor import Acceptor
from lfa.protocol.lease.candidate import Candidate
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.quorum import is_quorum
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import (
    NO_TERM,
    Config,
    Electorate,
    Fence,
    GatewayStamp,
    Grant,
    Grantee,
    Member,
    Prepare,
    Promise,
    Propose,
    Term,
    Version,
)
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel
from tests.model import register_state
from tests.model.voter_rules import may_grant, may_promise

GRANT_S = 2.0
"""Two instants of a bond: long enough to be renewed, to be refused and to run out."""
MEMBERS = (Member(1, 7), Member(2, 7), Member(3, 7))
TERMS = (Term(1, 1, 7), Term(1, 2, 7), Term(2, 1, 7))
"""Two of one number, two of one issuer."""
VERSIONS = (Version(NO_TERM, 0), Version(TERMS[0], 0), Version(TERMS[2], 1))


class VoterState(NamedTuple):
    """What the model knows of a voter; terms as places in TERMS, counted from 1."""

    promised: int = 0
    released: int = 0
    bond_term: int = 0
    bond_holder: int | None = None
    bond_left: int = 0
    version: int = 0


def config_of(version: int) -> Config:
    return Config(VERSIONS[version], MEMBERS, None, None, MEMBERS)


def rank_of(term: Term) -> int:
    return 0 if term == NO_TERM else 1 + TERMS.index(term)


def acceptor() -> int:
    """PREPARE, PROPOSE, RELEASE and time in every reachable state of an `Acceptor`."""
    start = Acceptor(NO_TERM, GRANT_S, -GRANT_S)
    seen = {VoterState()}
    queue = deque([(start, VoterState(), 0.0)])
    compared = 0
    while queue:
        voter, state, now = queue.popleft()
        for after, following, later in _answers(voter, state, now):
            compared += 1
            if following not in seen:
                seen.add(following)
                queue.append((after, following, later))
    return compared


def _answers(voter: Acceptor, state: VoterState, now: float) -> Iterator[tuple[Acceptor, VoterState, float]]:
    for k, version, gone in product((1, 2, 3), range(len(VERSIONS)), (False, True)):
        yield (*_prepare(copy(voter), state, now, k, version, gone), now)
    fences = [frozenset(c) for n in range(3) for c in combinations((1, 2, 3), n)]
    for k, version, holder, fenced in product((1, 2, 3), range(len(VERSIONS)), range(3), fences):
        yield (*_propose(copy(voter), state, now, k, version, holder, fenced), now)
    for k in (1, 2, 3):
        after = copy(voter)
        freed = after.release(TERMS[k - 1])
        following = state._replace(promised=max(state.promised, k), released=max(state.released, k))
        if state.bond_term == k:
            following = following._replace(bond_term=0, bond_holder=None, bond_left=0)
        # A bond that ran out may still be named: freeing that is no news.
        assert not freed or state.bond_term in (0, k), (state, k)
        yield _same(after, following, now), following, now
    left = max(0, state.bond_left - 1)
    following = state._replace(bond_left=left)
    if not left:
        following = following._replace(bond_term=0, bond_holder=None)
    yield _same(copy(voter), following, now + 1.0), following, now + 1.0


def _prepare(
    voter: Acceptor, state: VoterState, now: float, k: int, version: int, gone: bool
) -> tuple[Acceptor, VoterState]:
    asker = TERMS[k - 1].issuer - 1
    body = Prepare(TERMS[k - 1], VERSIONS[version])
    answer = voter.prepare(MEMBERS[asker], body, config_of(state.version), now, gone)
    may = state.version <= version and may_promise(
        k,
        asker,
        promised=state.promised,
        released=state.released,
        bond_holder=state.bond_holder,
        holder_gone=gone,
    )
    assert isinstance(answer, Promise) == may, (state, body, gone, answer)
    if isinstance(answer, Promise):
        named = answer.needs_fence
        assert (named is None) == (state.bond_holder is None), (state, body, answer)
        if named is not None:
            assert state.bond_holder is not None
            assert named == Grantee(TERMS[state.bond_term - 1], MEMBERS[state.bond_holder]), (state, answer)
    following = state._replace(promised=k) if may else state
    return _same(voter, following, now), following


def _propose(
    voter: Acceptor, state: VoterState, now: float, k: int, version: int, holder: int, fenced: frozenset[int]
) -> tuple[Acceptor, VoterState]:
    issuer = TERMS[k - 1].issuer - 1
    body = Propose(TERMS[k - 1], config_of(version), 0, MEMBERS[holder], tuple(TERMS[t - 1] for t in sorted(fenced)))
    answer = voter.propose(MEMBERS[issuer], body, config_of(state.version), now)
    may = state.version <= version and may_grant(
        k,
        holder,
        issuer,
        fenced,
        promised=state.promised,
        released=state.released,
        bond_term=state.bond_term,
        bond_holder=state.bond_holder,
    )
    assert isinstance(answer, Grant) == may, (state, body, answer)
    if not may:
        return _same(voter, state, now), state
    following = VoterState(k, state.released, k, holder, int(GRANT_S), version)
    return _same(voter, following, now), following


def _same(voter: Acceptor, state: VoterState, now: float) -> Acceptor:
    """The acceptor's state is the model's."""
    bond = voter.bound(now)
    is_now = (rank_of(voter.promised), rank_of(voter.released))
    assert is_now == (state.promised, state.released), (is_now, state)
    assert (bond is None) == (state.bond_term == 0), (bond, state)
    if bond is not None:
        assert (rank_of(bond.term), MEMBERS.index(bond.holder)) == (state.bond_term, state.bond_holder), (bond, state)
        assert bond.expiry - now == state.bond_left, (bond, state, now)
    return voter


def candidate() -> int:
    """A `Candidate` asks for grants only when a quorum promised and every lease named is fenced or its own."""
    me, compared = Member(1, 7), 0
    named = (None, Grantee(Term(1, 1, 7), me), Grantee(Term(1, 2, 7), MEMBERS[1]), Grantee(Term(2, 2, 7), MEMBERS[2]))
    config = Config(VERSIONS[0], MEMBERS, None, None, MEMBERS)
    others = named[2:]
    for promises in product(("silent", *named), repeat=3):
        for fenced in chain.from_iterable(combinations(others, n) for n in range(3)):
            attempt = Candidate(Term(9, 1, 7), timing_of("std"), 0.0)
            for member, needs in zip(MEMBERS, promises, strict=True):
                if needs != "silent":
                    attempt.promised(member, needs, False)  # type: ignore[arg-type]
            for grantee in fenced:
                assert grantee is not None
                attempt.fenced(grantee.holder.id, grantee.term)
            proposes = attempt.has_quorum(config) and not attempt.unfenced(me)
            fine = [p != "silent" and (p in named[:2] or p in fenced) for p in promises]
            assert not proposes or sum(fine) >= 2, (promises, fenced)
            assert set(attempt.fenced_terms) <= {g.term for g in fenced if g is not None}, (promises, fenced)
            compared += 1
    return compared


def quorums() -> int:
    """`is_quorum` and the register's rule for every pair of electorates over four members, and everyone present."""
    members, compared = tuple(Member(i, 0) for i in range(4)), 0
    sets = [tuple(members[i] for i in range(4) if mask >> i & 1) for mask in range(16)]
    for voters, previous, rule in product(range(1, 16), range(16), ("half", "all")):
        for tie, previous_tie in product((0, 1, 8), repeat=2):
            old = Electorate(sets[previous], _member(members, previous_tie), rule) if previous else None
            config = Config(VERSIONS[0], sets[voters], _member(members, tie), old, ())
            content = (
                voters,
                tie,
                previous,
                previous_tie,
                register_state.ALL if rule == "all" else register_state.HALF,
            )
            for present in range(16):
                ours = register_state.is_quorum(content, present)
                assert is_quorum(config, sets[present]) == ours, (config, sets[present])
                compared += 1
    return compared


def _member(members: tuple[Member, ...], mask: int) -> Member | None:
    return members[mask.bit_length() - 1] if mask else None


def holder() -> int:
    """A `Holder`'s lease ends T_act after the newest round that two of three granted: the model's two young grants."""
    timing, me, compared = timing_of("std"), Member(1, 7), 0
    config = Config(VERSIONS[0], MEMBERS, None, None, MEMBERS)
    for rounds in product((None, 0, 1, 2), repeat=3):
        held = Holder(me, Term(9, 1, 7), timing, 0.0, 1)
        for n in range(3):
            held.next_propose(config, float(n))
        for member, number in zip(MEMBERS, rounds, strict=True):
            if number is not None:
                held.granted(member, Grant(Term(9, 1, 7), number, VERSIONS[0], 50.0), config, 99.0)
        granted = sorted((float(n) for n in rounds if n is not None), reverse=True)
        expiry = granted[1] + timing.act_s if len(granted) >= 2 else None
        assert held.expiry == expiry, (rounds, held.expiry, expiry)
        compared += 1
    return compared


def gateway() -> int:
    """A `Gateway` obeys a leader of term k exactly while its floor is at most 2k and the stamp is not older than D."""
    timing, compared = timing_of("std"), 0
    terms = (NO_TERM, *TERMS)
    above = Term(1, 1, 8)  # just above TERMS[0]: floor 3
    steps: tuple[tuple[str, Term, int], ...] = (
        *(("obey", t, 2 * rank_of(t)) for t in TERMS),
        *(("fence", t, 2 * rank_of(t)) for t in TERMS),
        ("fence", above, 3),
    )
    for schedule in product(steps, repeat=3):
        for age in (0.0, timing.deadman_s - 0.001, timing.deadman_s + 0.001):
            real, floor, now = Gateway(1, 5, timing, 0.0), 0, 10.0
            for verb, term, twice in schedule:
                now += 1.0
                if verb == "fence":
                    real.fence(Fence(terms[0], term), now)
                    floor = max(floor, twice)
                else:
                    obeyed = real.command(_command(term, now - age), now) is None
                    # A step of a second is longer than D: no stamp is older than the one obeyed before.
                    assert obeyed == (twice >= floor and age <= timing.deadman_s), (schedule, age)
                    floor = max(floor, twice) if obeyed else floor
                compared += 1
    return compared


def _command(term: Term, stamped_at: float) -> CmdVel:
    stamp, grant_s = GatewayStamp(5, stamped_at), timing_of("std").grant_s
    return CmdVel(Header("robot1", 7, 0, 0.0), STILL, term, 1, True, stamp, grant_s=grant_s)


ALL = (acceptor, candidate, holder, gateway, quorums)
