"""Voters that are added while a lease shrinks, as a model, on the project's own `Holder`, `Acceptor` and quorums (E36).

The holder of three voters has asked for a lease of three units, then changes one voter for a newcomer (E17), by a joint
config and the one after it; each round asks for either length. What was sent can be received at any later time, once,
often or never. Checked at each step: FREE: while the lease is valid, no processes that are free to elect another are a
quorum of the newest config that one of them knows; KEPT: no bond ends before an earlier grant of it said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations

import msgspec
import pytest
from msgspec import Struct

from lfa.protocol.lease.acceptor import Acceptor, Bond
from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.quorum import is_quorum
from lfa.protocol.messages.consensus import Config, Electorate, Grant, Member, Propose, Version
from tests.model.checker import State, Step, Successor
from tests.model.lengths import LENGTHS, ME, OTHERS, TERM, TIMING, Chosen, ends_early
from tests.protocol.lease import plants_of_time as plants

NEWCOMER = Member(4, 1)
ALL = (ME, *OTHERS, NEWCOMER)
BEFORE, AFTER = (ME, *OTHERS), (ME, OTHERS[1], NEWCOMER)
CONFIGS = (
    Config(Version(TERM, 0), BEFORE, None, None, BEFORE),
    Config(Version(TERM, 1), AFTER, None, Electorate(BEFORE, None), BEFORE),
    Config(Version(TERM, 2), AFTER, None, None, AFTER),
)
NAMED = (BEFORE, ALL, AFTER)
"""Who votes in each config."""
UNKNOWN = -1

MUTANTS: dict[str, tuple[str, Callable[[pytest.MonkeyPatch], None]]] = {
    "asks_for_less": ("a round asks for less than an earlier one", plants.round_that_asks_for_less),
}


class Joined(Struct, frozen=True, array_like=True):
    """State: the time, the rounds sent, and what holder and voters have made of them."""

    now: float = 0.0
    rounds: tuple[tuple[float, float, int, int], ...] = ()
    """Send time, end of the lease asked for, bond asked for [ms] and config of each round."""
    expiry: float | None = None
    acked: tuple[float | None, ...] = (None,) * len(ALL)
    accepted: tuple[int, ...] = (UNKNOWN,) * len(ALL)
    """Newest config that each voter has granted, as the holder has heard."""
    bonds: tuple[float | None, ...] = (None,) * len(ALL)
    known: tuple[int, ...] = (0, 0, 0, UNKNOWN)
    """Newest config that each process knows."""
    granted: int = 0
    """Grants sent by the other voters (mask)."""


class JoinModel:
    columns = ("holder", "voter 2", "voter 3", "newcomer 4")

    def __init__(self, rounds: int, until: float, mutant: str = "") -> None:
        """So many rounds, the first of the longest lease, until the time `until`."""
        self.rounds, self.until, self.mutant = rounds, until, mutant

    def initial(self) -> State:
        [(_, _, first)] = list(_asked(Joined(), 0, LENGTHS[-1:]))
        return msgspec.msgpack.encode(first)

    def step(self, event: tuple[object, ...]) -> Step:
        column, text = event
        assert column is None or isinstance(column, int)
        return Step(column, str(text))

    def successors(self, state: State) -> list[Successor]:
        s = msgspec.msgpack.decode(state, type=Joined)
        with pytest.MonkeyPatch.context() as patch:
            if self.mutant:
                MUTANTS[self.mutant][1](patch)
            found = [*self._ticks(s), *self._asks(s), *_grants(s), *_counts(s)]
        return [((column, text), msgspec.msgpack.encode(after), _wrong(s, after)) for column, text, after in found]

    def _ticks(self, s: Joined) -> Iterator[tuple[int | None, str, Joined]]:
        if s.now < self.until:
            yield None, "a tick", msgspec.structs.replace(s, now=s.now + 1.0)

    def _asks(self, s: Joined) -> Iterator[tuple[int | None, str, Joined]]:
        """Send a round of either length, with the present config, or with the next one when that is committed."""
        if len(s.rounds) == self.rounds or _is_over(s):
            return
        config = s.known[0]
        yield from _asked(s, config, LENGTHS)
        if config + 1 < len(CONFIGS) and _holder(s, LENGTHS[-1]).committed(CONFIGS[config]):
            yield from _asked(s, config + 1, LENGTHS)


def _asked(s: Joined, config: int, lengths: range) -> Iterator[tuple[int | None, str, Joined]]:
    """The states after a round with that config, which the holder grants at once."""
    for index in lengths:
        holder = _holder(s, index)
        propose = holder.next_propose(CONFIGS[config], s.now)
        asked = (*s.rounds, (*holder._rounds[propose.round], propose.grant_ms, config))
        own = msgspec.structs.replace(s, rounds=asked)
        holder.granted(ME, Grant(TERM, propose.round, CONFIGS[config].version, 0.0), CONFIGS[config], s.now)
        after = _after(_told(own, 0, propose, config), holder)
        yield 0, f"ask for {holder.timing.act_s:g} with config {config}, round {propose.round}", after


def _grants(s: Joined) -> Iterator[tuple[int | None, str, Joined]]:
    """A voter receives any round that was sent, with a config that names it and is none older than it knows."""
    for v in range(1, len(ALL)):
        for number, (_, _, grant_ms, config) in enumerate(s.rounds):
            if ALL[v] in NAMED[config] and config >= s.known[v]:
                told = _told(s, v, Propose(TERM, CONFIGS[config], number, ME, grant_ms=grant_ms), config)
                yield v, f"grant round {number}", msgspec.structs.replace(told, granted=s.granted | _bit(v, number))


def _counts(s: Joined) -> Iterator[tuple[int | None, str, Joined]]:
    """The holder receives any grant that was sent, while it leads or hopes to."""
    if _is_over(s):
        return
    for v in range(1, len(ALL)):
        for number, (_, _, _, config) in enumerate(s.rounds):
            if s.granted & _bit(v, number):
                holder, own = _holder(s, LENGTHS[-1]), CONFIGS[s.known[0]]
                holder.granted(ALL[v], Grant(TERM, number, CONFIGS[config].version, 0.0), own, s.now)
                yield 0, f"count round {number} of {ALL[v].id}", _after(s, holder)


def _is_over(s: Joined) -> bool:
    return s.expiry is not None and s.expiry <= s.now


def _bit(v: int, number: int) -> int:
    return 1 << (len(ALL) * number + v)


def _holder(s: Joined, length: int) -> Holder:
    """The holder in this state, which asks for leases of that length."""
    holder = Holder(ME, TERM, TIMING, 0.0, agreed=1)
    holder._length = Chosen(length)  # type: ignore[assignment]
    holder._round, holder.expiry = len(s.rounds), s.expiry
    holder._rounds = {number: (sent_at, end) for number, (sent_at, end, _, _) in enumerate(s.rounds)}
    holder._until = max((end for _, end, _, _ in s.rounds), default=holder._until)
    holder._acked = {voter: end for voter, end in zip(ALL, s.acked, strict=True) if end is not None}
    heard = zip(ALL, s.accepted, strict=True)
    holder._accepted = {voter: CONFIGS[config].version for voter, config in heard if config != UNKNOWN}
    return holder


def _after(s: Joined, holder: Holder) -> Joined:
    acked = tuple(holder._acked.get(voter) for voter in ALL)
    versions = [config.version for config in CONFIGS]
    accepted = (holder._accepted.get(voter) for voter in ALL)
    places = tuple(UNKNOWN if version is None else versions.index(version) for version in accepted)
    return msgspec.structs.replace(s, acked=acked, accepted=places, expiry=holder.expiry)


def _told(s: Joined, v: int, propose: Propose, config: int) -> Joined:
    """The state after voter v has received a round: bound, and with its config."""
    voter, end = Acceptor(TERM, TIMING.grant_s, -TIMING.grant_s), s.bonds[v]
    voter.bond = None if end is None else Bond(TERM, ME, end)
    voter.propose(ME, propose, CONFIGS[config], s.now)
    ends = tuple(voter.bond.expiry if i == v and voter.bond is not None else end for i, end in enumerate(s.bonds))
    known = tuple(max(one, config) if i == v else one for i, one in enumerate(s.known))
    return msgspec.structs.replace(s, bonds=ends, known=known)


def _wrong(before: Joined, s: Joined) -> str | None:
    kept = ends_early(before.now, before.bonds, s.bonds)
    if kept is not None or s.expiry is None or s.expiry <= s.now:
        return kept
    free = [v for v, end in enumerate(s.bonds) if s.known[v] != UNKNOWN and (end is None or end <= s.now)]
    for count in range(1, len(free) + 1):
        for some in combinations(free, count):
            newest = max(s.known[v] for v in some)
            if is_quorum(CONFIGS[newest], [ALL[v] for v in some]):
                who = ", ".join(str(ALL[v].id) for v in some)
                return f"FREE: the lease lasts until {s.expiry:g}, and {who} may elect another at {s.now:g}"
    return None
