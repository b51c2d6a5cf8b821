"""One attempt to lead: a term, the promises for it, and when to ask again (rule E5).

The term stays the same while the attempt only repeats itself, so a robot that nobody hears does not drive terms up.
"""

from __future__ import annotations

from collections.abc import Callable

from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.membership import ANY_LIFE
from lfa.protocol.lease.quorum import electors, is_quorum
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import NO_TERM, Config, Grantee, Member, Term
from lfa.protocol.names import WITNESS_ID

PAUSE_GROWTH = 1.5


class Candidate:
    def __init__(self, term: Term, timing: Timing, now: float, forget: tuple[Member, ...] = ()) -> None:
        """`forget`: lives that an operator declared dead for this attempt (E20)."""
        self.term = term
        self.forget = forget
        self.began_at = now
        self.ask_at = now
        self.holder: Holder | None = None
        """Set once the first PROPOSE has left: the term as it is being granted."""
        self.transferred = False
        """The term was handed over by its issuer (E16): this process only counts the grants."""
        self._promised: dict[Member, Grantee | None] = {}
        self._absent: frozenset[Grantee] = frozenset()
        """E21: stands for whatever a robot that did not promise may still command."""
        self._fenced: set[Grantee] = set()
        self._with_state: set[Member] = set()
        self._refused: set[Member] = set()
        self._bound_until = now
        self._act_s = timing.act_s
        self._fences_asked: set[Grantee] = set()
        self._pause_s = 2.0 * timing.rank_step_s
        self._pause_s_max = timing.heartbeat_s

    def asked(self, now: float) -> None:
        """A PREPARE leaves: each pause is longer than the one before, up to a heartbeat."""
        self.ask_at = now + self._pause_s
        self._fences_asked.clear()
        self._bound_until = now
        self._pause_s = min(self._pause_s * PAUSE_GROWTH, self._pause_s_max)

    def wait_until(self, at: float) -> None:
        """A voter is bound until then: ask again exactly when all that refused are free."""
        self._bound_until = max(self._bound_until, at)
        self.ask_at = self._bound_until

    @property
    def deadline(self) -> float:
        if self.holder is None:
            return self.ask_at
        return self.gives_up_at if self.transferred else self.holder.next_round_at

    @property
    def gives_up_at(self) -> float:
        """Without a quorum's grants by then, what was granted is worth nothing any more."""
        return float("inf") if self.holder is None else self.holder.began_at + self._act_s

    def promised(self, src: Member, needs_fence: Grantee | None, blank: bool) -> None:
        """The newest answer of a voter counts: a bond that it named before may have run out since."""
        self._promised[src] = needs_fence
        if not blank:
            self._with_state.add(src)

    def fenced(self, robot_id: int, old: Term) -> None:
        """The gateway of `robot_id` refuses `old`."""
        self._fenced |= {g for g in self._named() if (g.holder.id, g.term) == (robot_id, old)}

    def unfenced(self, me: Member) -> list[Grantee]:
        """E15: leases that promisers are still bound to, and whose gateways have not answered yet."""
        return sorted((g for g in self._named() - self._fenced if g.holder != me), key=_of_whom)

    def _named(self) -> set[Grantee]:
        return {g for g in self._promised.values() if g is not None} | self._absent

    def fences_to_ask(self, me: Member) -> list[Grantee]:
        """Of these the ones not asked for since the last PREPARE."""
        due = [grantee for grantee in self.unfenced(me) if grantee not in self._fences_asked]
        self._fences_asked.update(due)
        return due

    @property
    def fenced_terms(self) -> tuple[Term, ...]:
        return tuple(sorted(grantee.term for grantee in self._fenced if grantee.term != NO_TERM))

    def refused(self, src: Member, config: Config, ended: Callable[[Member], bool]) -> bool:
        """`src` has promised a higher term; answers whether this one is beaten.

        While it only asks, at once: a higher term of its own costs nothing. Once grants are on their way, only
        when no quorum is left: a late refusal by one voter must not undo an election that the others have made.
        A life that has `ended` leaves none: counted in, it would hold an attempt that nobody can grant for T_act.
        """
        self._refused.add(src)
        if self.holder is None:
            return True
        granted = self.holder.nonces
        left = [m for m in electors(config) if m not in self._refused and (m in granted or not ended(m))]
        return not is_quorum(config, left)

    def has_quorum(self, config: Config) -> bool:
        """E18: only lives that `config` names, and that know of a config, count."""
        return is_quorum(config, self._with_state)

    def _answering(self, superseded: Callable[[Member], bool]) -> dict[int, Member]:
        """Of each id the newest life that promised. One that a later life has replaced cannot grant any more:
        counted in, it would hold an attempt that needs all of them for T_act."""
        return {m.id: m for m in sorted(self._promised) if not superseded(m)}

    def full_house(
        self, config: Config, universe: tuple[int, ...], superseded: Callable[[Member], bool]
    ) -> tuple[Member, ...]:
        """E18: the newest life of every id, when all have promised and hold no quorum of `config`; else nobody.

        Of the ids that are forgotten in this attempt none is needed (E20).
        """
        lives = self._answering(superseded)
        forgotten = {m.id for m in self.forget}
        if not all(i in lives or i in forgotten for i in universe) or self.has_quorum(config):
            return ()
        return tuple(lives[i] for i in universe if i in lives)

    def blank_majority(self, universe: tuple[int, ...], superseded: Callable[[Member], bool]) -> tuple[Member, ...]:
        """E19: the newest lives of more than half of all ids, the witness (last of `universe`) among them; else nobody.

        One promiser that remembers a config is enough to forbid it.
        """
        lives = self._answering(superseded)
        here = tuple(lives[i] for i in universe if i in lives)
        fine = 2 * len(here) > len(universe) and universe[-1] in lives and not self._with_state
        return here if fine else ()

    def whoever_answers(self, universe: tuple[int, ...], superseded: Callable[[Member], bool]) -> tuple[Member, ...]:
        """E21: the newest lives that promised. Every other robot's gateway is to refuse what is below, first."""
        lives = self._answering(superseded)
        absent = (i for i in universe if i not in lives and i != WITNESS_ID)
        self._absent = frozenset(Grantee(NO_TERM, Member(i, ANY_LIFE)) for i in absent)
        return tuple(lives[i] for i in universe if i in lives)

    def expects_nobody(self) -> None:
        """E21 does not apply (any more)."""
        self._absent = frozenset()


def _of_whom(grantee: Grantee) -> tuple[Term, Member]:
    return grantee.term, grantee.holder
