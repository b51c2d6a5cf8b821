"""Leases of several lengths as a model, on the project's own `Holder` and `Acceptor` (E36).

One holder of three voters asks in each round for a lease of either length, in any order. What was sent can be received
at any later time, once, often or never. Checked at each step: FREE: while the lease is valid, no quorum of voters is
free to elect another; KEPT: no bond ends before an earlier grant of it said. Clocks run alike here: the margin between
a lease and its bond is the same formula for each length, and `lease_core.py` has the clocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import msgspec
import pytest
from msgspec import Struct

from lfa.protocol.lease.acceptor import Acceptor, Bond
from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.timing import Timing, lengths_of
from lfa.protocol.messages.consensus import Config, Grant, Member, Propose, Term, Version
from tests.model.checker import State, Step, Successor
from tests.protocol.lease import plants_of_time as plants

ME, OTHERS = Member(1, 1), (Member(2, 1), Member(3, 1))
VOTERS = (ME, *OTHERS)
TERM = Term(5, 1, 1)
CONFIG = Config(Version(TERM), VOTERS, None, None, VOTERS)
TIMING = Timing(1.0, 3.0, 0.0, 0.1, 6.0, 12.0, (1.0,))
"""Leases of three units and of one; a bond outlasts its lease by less than a unit."""
LENGTHS = range(len(lengths_of(TIMING)))

MUTANTS: dict[str, tuple[str, Callable[[pytest.MonkeyPatch], None]]] = {
    "shortened": ("a shorter round shortens the bond", plants.shorter_round_shortens_the_bond),
    "asked_for_now": ("a lease as long as is asked for now", plants.lease_as_long_as_is_asked_for_now),
}


class Chosen:
    """Length that the model has chosen for the rounds from now on."""

    def __init__(self, index: int) -> None:
        self.timing = lengths_of(TIMING)[index]

    def fit(self, took_s: float, now: float) -> None:
        """Keep the length: the model asks for any at any time."""


class Leased(Struct, frozen=True, array_like=True):
    """State: the time, the rounds sent, and what holder and voters have made of them."""

    now: float = 0.0
    rounds: tuple[tuple[float, float, int], ...] = ()
    """Send time, end of the lease asked for, and bond asked for [ms] of each round."""
    length: int = LENGTHS[-1]
    expiry: float | None = None
    acked: tuple[float | None, ...] = (None,) * len(VOTERS)
    bonds: tuple[float | None, ...] = (None,) * len(VOTERS)
    granted: int = 0
    """Grants sent by the other voters (mask)."""


class LengthModel:
    columns = ("holder", "voter 2", "voter 3")

    def __init__(self, rounds: int, until: float, mutant: str = "") -> None:
        """So many rounds, until the time `until`."""
        self.rounds, self.until, self.mutant = rounds, until, mutant

    def initial(self) -> State:
        return msgspec.msgpack.encode(Leased())

    def step(self, event: tuple[object, ...]) -> Step:
        column, text = event
        assert column is None or isinstance(column, int)
        return Step(column, str(text))

    def successors(self, state: State) -> list[Successor]:
        s = msgspec.msgpack.decode(state, type=Leased)
        with pytest.MonkeyPatch.context() as patch:
            if self.mutant:
                MUTANTS[self.mutant][1](patch)
            found = [*self._ticks(s), *self._asks(s), *self._grants(s), *self._counts(s)]
        return [((column, text), msgspec.msgpack.encode(after), _wrong(s, after)) for column, text, after in found]

    def _ticks(self, s: Leased) -> Iterator[tuple[int | None, str, Leased]]:
        if s.now < self.until:
            yield None, "a tick", msgspec.structs.replace(s, now=s.now + 1.0)

    def _asks(self, s: Leased) -> Iterator[tuple[int | None, str, Leased]]:
        """Send a round of either length; the own voter grants at once."""
        if len(s.rounds) == self.rounds or _is_over(s):
            return
        for index in LENGTHS:
            holder = _holder(msgspec.structs.replace(s, length=index))
            propose = holder.next_propose(CONFIG, s.now)
            asked = (*s.rounds, (*holder._rounds[propose.round], propose.grant_ms))
            own = msgspec.structs.replace(s, rounds=asked, length=index, bonds=_bound(s, 0, propose))
            holder.granted(ME, _grant(propose.round), CONFIG, s.now)
            yield 0, f"ask for {holder.timing.act_s:g}, round {propose.round}", _after(own, holder)

    def _grants(self, s: Leased) -> Iterator[tuple[int | None, str, Leased]]:
        """A voter receives any round that was sent."""
        for v in range(1, len(VOTERS)):
            for number, (_, _, grant_ms) in enumerate(s.rounds):
                propose = Propose(TERM, CONFIG, number, ME, grant_ms=grant_ms)
                mask = s.granted | _bit(v, number)
                yield v, f"grant round {number}", msgspec.structs.replace(s, bonds=_bound(s, v, propose), granted=mask)

    def _counts(self, s: Leased) -> Iterator[tuple[int | None, str, Leased]]:
        """The holder receives any grant that was sent, while it leads or hopes to."""
        if _is_over(s):
            return
        for v in range(1, len(VOTERS)):
            for number in range(len(s.rounds)):
                if s.granted & _bit(v, number):
                    holder = _holder(s)
                    holder.granted(VOTERS[v], _grant(number), CONFIG, s.now)
                    yield 0, f"count round {number} of voter {v + 1}", _after(s, holder)


def _is_over(s: Leased) -> bool:
    return s.expiry is not None and s.expiry <= s.now


def _bit(v: int, number: int) -> int:
    return 1 << (len(VOTERS) * number + v)


def _grant(number: int) -> Grant:
    return Grant(TERM, number, CONFIG.version, 0.0)


def _holder(s: Leased) -> Holder:
    """The holder in this state."""
    holder = Holder(ME, TERM, TIMING, 0.0, agreed=1)
    holder._length = Chosen(s.length)  # type: ignore[assignment]
    holder._round, holder.expiry = len(s.rounds), s.expiry
    holder._rounds = {number: (sent_at, end) for number, (sent_at, end, _) in enumerate(s.rounds)}
    holder._until = max((end for _, end, _ in s.rounds), default=holder._until)
    holder._acked = {voter: end for voter, end in zip(VOTERS, s.acked, strict=True) if end is not None}
    return holder


def _after(s: Leased, holder: Holder) -> Leased:
    acked = tuple(holder._acked.get(voter) for voter in VOTERS)
    rounds = tuple((*holder._rounds[n], grant_ms) for n, (_, _, grant_ms) in enumerate(s.rounds))
    return msgspec.structs.replace(s, rounds=rounds, acked=acked, expiry=holder.expiry)


def _bound(s: Leased, v: int, propose: Propose) -> tuple[float | None, ...]:
    """The ends of all bonds after voter v has received a round."""
    voter, end = Acceptor(Term(), TIMING.grant_s, -TIMING.grant_s), s.bonds[v]
    voter.bond = None if end is None else Bond(TERM, ME, end)
    voter.propose(ME, propose, CONFIG, s.now)
    return tuple(voter.bond.expiry if i == v and voter.bond is not None else end for i, end in enumerate(s.bonds))


def ends_early(now: float, before: Sequence[float | None], bonds: Sequence[float | None]) -> str | None:
    """Return what breaks KEPT; None if nothing: whoever was bound before is so for as long, or longer."""
    for v, (earlier, end) in enumerate(zip(before, bonds, strict=True)):
        if earlier is not None and now < earlier and (end is None or end < earlier):
            return f"KEPT: voter {v + 1} was bound until {earlier:g}, and is until {end}"
    return None


def _wrong(before: Leased, s: Leased) -> str | None:
    kept = ends_early(before.now, before.bonds, s.bonds)
    if kept is not None:
        return kept
    free = [v for v, end in enumerate(s.bonds) if end is None or end <= s.now]
    if s.expiry is not None and s.now < s.expiry and 2 * len(free) > len(VOTERS):
        return f"FREE: the lease lasts until {s.expiry:g}, and of its voters {len(free)} are free at {s.now:g}"
    return None
