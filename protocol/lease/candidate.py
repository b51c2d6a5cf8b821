"""One candidacy: its term, the promises for it, and the time of the next PREPARE (rules E5, E6, E15, E18-E21).

The term stays the same while PREPAREs are only repeated, so an unheard robot does not increase terms.
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
    """One attempt to get a lease: phase 1 until `holder` is set, then phase 2."""

    def __init__(self, term: Term, timing: Timing, now: float, forget: tuple[Member, ...] = ()) -> None:
        """Start a candidacy; `forget`: incarnations that an operator declared dead for this attempt (E20)."""
        self.term = term
        self.forget = forget
        self.began_at = now
        self.ask_at = now
        self.holder: Holder | None = None
        """Holder state of the term while it is being granted; set when the first PROPOSE is sent."""
        self.transferred = False
        """True if the issuer handed the term over (E16): this process only counts the grants."""
        self.fencing = False
        """True while enough have promised, but a gateway has still to confirm its fence (E15)."""
        self._promised: dict[Member, Grantee | None] = {}
        self._absent: frozenset[Grantee] = frozenset()
        """Placeholders for the leases of robots that did not promise and may still command (E21)."""
        self._fenced: set[Grantee] = set()
        self._with_state: set[Member] = set()
        self._refused: set[Member] = set()
        self._bound_until = now
        self._act_s = timing.act_s
        self._fences_asked: set[Grantee] = set()
        self._pause_s = 2.0 * timing.rank_step_s
        self._pause_s_max = timing.heartbeat_s

    def asked(self, now: float) -> None:
        """Record that a PREPARE is sent at `now` [s]; each pause until the next is longer, up to a heartbeat."""
        self.ask_at = now + self._pause_s
        self._fences_asked.clear()
        self._bound_until = now
        self._pause_s = min(self._pause_s * PAUSE_GROWTH, self._pause_s_max)

    def wait_until(self, at: float) -> None:
        """Schedule the next PREPARE for `at` [s], when a refusing voter's bond ends, or later if another ends later."""
        self._bound_until = max(self._bound_until, at)
        self.ask_at = self._bound_until

    @property
    def gives_up_at(self) -> float:
        """Time [s] at which the candidacy is abandoned: grants received by then without a quorum have expired."""
        return float("inf") if self.holder is None else self.holder.began_at + self._act_s

    def promised(self, src: Member, needs_fence: Grantee | None, blank: bool) -> None:
        """Record a promise; a voter's newest answer replaces the earlier one, whose bond may have expired."""
        self._promised[src] = needs_fence
        if not blank:
            self._with_state.add(src)

    def fenced(self, robot_id: int, old: Term) -> None:
        """Record that the gateway of `robot_id` refuses the term `old`."""
        self._fenced |= {g for g in self._named() if (g.holder.id, g.term) == (robot_id, old)}

    def unfenced(self, me: Member) -> list[Grantee]:
        """Return the leases of other holders that promisers are bound to and that are not fenced yet (E15), sorted."""
        return sorted((g for g in self._named() - self._fenced if g.holder != me), key=_of_whom)

    def _named(self) -> set[Grantee]:
        return {g for g in self._promised.values() if g is not None} | self._absent

    def fences_to_ask(self, me: Member) -> list[Grantee]:
        """Return the unfenced leases for which no FENCE was sent since the last PREPARE, and mark them as sent."""
        due = [grantee for grantee in self.unfenced(me) if grantee not in self._fences_asked]
        self._fences_asked.update(due)
        return due

    @property
    def fenced_terms(self) -> tuple[Term, ...]:
        """Terms that gateways have confirmed to refuse, sorted; voters bound under them are free (E3)."""
        return tuple(sorted(grantee.term for grantee in self._fenced if grantee.term != NO_TERM))

    def refused(self, src: Member, config: Config, ended: Callable[[Member], bool]) -> bool:
        """Record that `src` has promised a higher term; return True if this candidacy is beaten.

        In phase 1 it is beaten at once: a higher term of its own costs nothing. In phase 2 it is beaten only if no
        quorum is left: a late refusal by one voter must not undo an election that the others have made. An incarnation
        that has `ended` without a grant does not count towards that quorum; otherwise an attempt that can no longer
        be granted would go on for T_act.
        """
        self._refused.add(src)
        if self.holder is None:
            return True
        granted = self.holder.nonces
        left = [m for m in electors(config) if m not in self._refused and (m in granted or not ended(m))]
        return not is_quorum(config, left)

    def has_quorum(self, config: Config) -> bool:
        """Return True if a quorum of `config` has promised; only incarnations that know a config count (E18)."""
        return is_quorum(config, self._with_state)

    def _answering(self, superseded: Callable[[Member], bool]) -> dict[int, Member]:
        """Return the newest incarnation that promised, by id, without superseded ones.

        A superseded incarnation cannot grant any more; counted in, it would block a unanimous attempt for T_act.
        """
        return {m.id: m for m in sorted(self._promised) if not superseded(m)}

    def full_house(
        self, config: Config, member_ids: tuple[int, ...], superseded: Callable[[Member], bool]
    ) -> tuple[Member, ...]:
        """Return the members of a unanimous start (E18): the newest incarnation of every id.

        Empty unless all ids have promised, without a quorum of `config`. Ids that this attempt forgets are not needed
        (E20), nor are spares: with them, every quorum holds an id of the mission. Those that promise take part (E33).
        """
        answering = self._answering(superseded)
        forgotten = {m.id for m in self.forget}
        if not all(i in answering or i in forgotten for i in member_ids) or self.has_quorum(config):
            return ()
        spares = (spare.id for spare in config.roster.spares)
        return tuple(answering[i] for i in (*member_ids, *spares) if i in answering)

    def blank_majority(self, member_ids: tuple[int, ...], superseded: Callable[[Member], bool]) -> tuple[Member, ...]:
        """Return the newest incarnations of more than half of all ids, the witness (the last id) included (E19).

        Empty if there are too few, or if a single promiser remembers a config.
        """
        answering = self._answering(superseded)
        here = tuple(answering[i] for i in member_ids if i in answering)
        fine = 2 * len(here) > len(member_ids) and member_ids[-1] in answering and not self._with_state
        return here if fine else ()

    def any_answering(self, member_ids: tuple[int, ...], superseded: Callable[[Member], bool]) -> tuple[Member, ...]:
        """Return the newest incarnations that promised (E21); the gateways of all other robots must be fenced first."""
        answering = self._answering(superseded)
        absent = (i for i in member_ids if i not in answering and i != WITNESS_ID)
        self._absent = frozenset(Grantee(NO_TERM, Member(i, ANY_LIFE)) for i in absent)
        return tuple(answering[i] for i in member_ids if i in answering)

    def expects_nobody(self) -> None:
        """Clear the placeholders of absent robots: E21 does not apply (any more)."""
        self._absent = frozenset()


def _of_whom(grantee: Grantee) -> tuple[Term, Member]:
    return grantee.term, grantee.holder
