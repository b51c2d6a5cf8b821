"""Which rule of the protocol was broken when an invariant falls in a schedule of `lfa fuzz`, by what was observed.

A watch hears the same facts as the checkers, and remembers those that tell rules apart: who granted, promised, started
and saw tokens vanish, when. The rule of a violation is looked up with them; nothing of the code is looked into.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from msgspec import Struct

from lfa.deploy.analysis.causes import liveness_rules
from lfa.deploy.analysis.causes.fact_log import BrokenRule, CauseStep, FactLog, called, chain
from lfa.deploy.analysis.verification.checker import EARLY_S, LONG_AGO, Checker, Violation, shown
from lfa.protocol.lease.timing import CLOCK_RATE_ERROR, Timing
from lfa.protocol.messages.consensus import Grant, Member, Promise, Propose, Term
from lfa.protocol.messages.stop import NO_STOP, StopWord


class TwoGrants(Struct, frozen=True):
    """Two grants of one voter, of different terms: the earlier and the later, each at its true time [s]."""

    voter: Member
    earlier_s: float
    earlier: Term
    later_s: float
    later: Term
    bound_s: float
    """Time [s] from the earlier grant for which it bound the voter: what its holder's rounds had asked for (E36)."""

    def steps(self) -> tuple[CauseStep, CauseStep]:
        who = called(self.voter)
        return (
            CauseStep(
                self.earlier_s, f"{who} granted term {self.earlier.n} of {self.earlier.issuer}, and was bound by it"
            ),
            CauseStep(self.later_s, f"{who} granted term {self.later.n} of {self.later.issuer}"),
        )


class RuleWatch(Checker):
    """Memory of the facts that tell rules apart, and the rule of a violation by them."""

    name = "rules"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self.log = FactLog(timing)
        """Facts of the leases; a checker of the schedule too. For what falls long after a rule was broken."""
        self._bond_s = (timing.act_s + timing.deadman_s) * (1.0 + CLOCK_RATE_ERROR) / (1.0 - CLOCK_RATE_ERROR)
        """T_grant by E2, from the mission's durations alone."""
        self._granted: dict[Member, list[tuple[float, Term, float]]] = {}
        """Grants of each voter: time [s], term, and the end [s] of the bond by the rounds that it has granted."""
        self._asked_s: dict[tuple[Term, int], float] = {}
        """Bond [s] that a round has asked for, where that is shorter than T_grant (E36)."""
        self._proposed: dict[Term, tuple[float, Member, Propose]] = {}
        self._shorter_s: dict[Term, float] = {}
        """Time [s] of the newest round of each term that asked for a shorter bond than T_grant (E36)."""
        self._promised: dict[Term, list[tuple[float, Member]]] = {}
        self._hinted: dict[tuple[Member, Member], float] = {}
        self._began: dict[Member, float] = {}
        self._gateway_began: dict[int, float] = {}
        self._acknowledged: dict[int, tuple[float, StopWord]] = {}
        self._turned: tuple[int, StopWord] = (0, NO_STOP)
        """Robot whose wheels turned last, and what its gateway knew."""
        self.foreign: set[Member] = set()
        self.broken_rules: list[tuple[Violation, BrokenRule | None]] = []

    # --- facts -------------------------------------------------------------------------------------------------

    def lives(self, at: float, who: Member) -> None:
        self._began[who] = at

    def speaks(self, at: float, who: Member) -> None:
        self.foreign.add(who)

    def hinted(self, at: float, who: Member, about: Member) -> None:
        self._hinted[who, about] = at

    def grants(self, at: float, voter: Member, grant: Grant, until: float) -> None:
        own = self._granted.setdefault(voter, [])
        bond_s = min(self._bond_s, self._asked_s.get((grant.term, grant.round), self._bond_s))
        ends_s = at + bond_s * (1.0 - CLOCK_RATE_ERROR)
        same_holder = own and self._holder_of(own[-1][1]) == self._holder_of(grant.term)
        own.append((at, grant.term, max(ends_s, own[-1][2]) if same_holder else ends_s))

    def promises(self, at: float, who: Member, promise: Promise) -> None:
        self._promised.setdefault(promise.term, []).append((at, who))

    def proposes(self, at: float, who: Member, propose: Propose) -> None:
        self._proposed[propose.term] = at, who, propose
        if propose.grant_ms:
            self._shorter_s[propose.term] = at
            self._asked_s[propose.term, propose.round] = propose.grant_ms / 1000.0

    def gateway_starts(self, at: float, robot_id: int, shut_until: float) -> None:
        self._gateway_began[robot_id] = at

    def stop_acknowledged(self, at: float, robot_id: int, word: StopWord) -> None:
        self._acknowledged[robot_id] = at, word

    def turns(self, at: float, robot_id: int, word: StopWord) -> None:
        self._turned = robot_id, word

    # --- the rule ----------------------------------------------------------------------------------------------

    def note(self, violation: Violation) -> None:
        """Look the rule of a violation up, at the moment at which the violation is found."""
        explain = _BY_INVARIANT.get(violation.name)
        found = liveness_rules.found(self.log, violation) if explain is None else explain(self, violation)
        self.broken_rules.append((violation, found))

    def last_grants(self, before_s: float) -> TwoGrants | None:
        """Return the last two grants of different terms of the voter of the newest grant up to a time."""
        latest = max(
            self._granted.items(), key=lambda item: max((t for t, _, _ in item[1] if t <= before_s), default=-1.0)
        )
        voter, grants = latest
        at, term, _ = grants[-1]
        earlier = [one for one in grants if one[1] != term]
        return _two(voter, earlier[-1], at, term) if earlier else None

    def overlapping(self, before_s: float) -> TwoGrants | None:
        """Return the newest two grants of one voter, the later within the bond of the earlier, of different holders."""
        found = []
        for voter, grants in self._granted.items():
            for earlier, (at, term, _) in pairwise(grants):
                bound = at <= before_s and at < earlier[2]
                if bound and self._holder_of(earlier[1]) != self._holder_of(term):
                    found.append(_two(voter, earlier, at, term))
        return max(found, key=lambda two: two.later_s, default=None)

    def _holder_of(self, term: Term) -> Member:
        return self._proposed[term][2].holder

    def asked_before(self, term: Term) -> Term | None:
        """Return a lower term of the same candidate that was promised and never proposed."""
        same = [one for one in self._promised if (one.issuer, one.incarnation) == (term.issuer, term.incarnation)]
        return max((one for one in same if one < term and one not in self._proposed), default=None)

    def promise_of_a_newcomer(self, term: Term) -> tuple[float, Member] | None:
        """Return a promise for `term` that came from a process in its first T_grant."""
        for at, who in self._promised.get(term, []):
            if at - self._began.get(who, LONG_AGO) < self._bond_s:
                return at, who
        return None


def _two(voter: Member, earlier: tuple[float, Term, float], at: float, term: Term) -> TwoGrants:
    earlier_s, first, ends_s = earlier
    return TwoGrants(voter, earlier_s, first, at, term, ends_s - earlier_s)


def _always(rule: str, text: str) -> Callable[[RuleWatch, Violation], BrokenRule | None]:
    """Return the rule of an invariant that only one rule keeps, with what it demands."""
    return lambda watch, violation: chain(violation, rule, CauseStep(violation.at, text))


def _exclusive(watch: RuleWatch, violation: Violation) -> BrokenRule | None:
    """I1: some voter has granted both leases, the later within its bond to the earlier."""
    two = watch.overlapping(violation.at)
    if two is None:
        return None
    text = f"a bond outlives its lease: it lasts {two.bound_s:.3f} s"
    return chain(violation, "E2", *two.steps(), CauseStep(two.later_s, text))


def _bond(watch: RuleWatch, violation: Violation) -> BrokenRule | None:
    """I4: a fence in vain, a token that vanished, a bond that was shortened, or a grant in spite of the bond."""
    two = watch.last_grants(violation.at)
    if two is None:
        return None
    steps = two.steps()
    if two.earlier in watch._proposed[two.later][2].fenced:
        return chain(violation, "E15", *steps, CauseStep(two.later_s, "its holder's gateway had not been fenced"))
    hinted_s = watch._hinted.get((two.voter, watch._proposed[two.earlier][2].holder), LONG_AGO)
    if hinted_s >= two.earlier_s:
        text = f"{called(two.voter)} saw the token of the lease's holder vanish, which proves nothing"
        return chain(violation, "E15 E3", *steps, CauseStep(hinted_s, text))
    if two.earlier in watch._shorter_s:
        text = f"a round of term {two.earlier.n} asked for a shorter bond, which shortens no longer one"
        return chain(violation, "E36 E3", *steps, CauseStep(watch._shorter_s[two.earlier], text))
    return chain(violation, "E3", *steps)


def _amnesiac(watch: RuleWatch, violation: Violation) -> BrokenRule | None:
    """I7: who proposed the term, and what its promises were worth."""
    term = max(watch._proposed, key=lambda one: watch._proposed[one][0])
    at, who, propose = watch._proposed[term]
    if (who.id, who.incarnation) != (term.issuer, term.incarnation) or propose.holder != who:
        text = f"{called(who)} proposed term {term.n} of {term.issuer}, which was handed over, as a new one"
        return chain(violation, "E16", CauseStep(at, text))
    promises = watch._promised.get(term, [])
    if not promises:
        others = [(t, one) for one, some in watch._promised.items() if one.issuer == who.id for t, _ in some[-1:]]
        if not others or max(others)[0] < at - watch._bond_s:
            text = f"{called(who)} proposed term {term.n} without having asked for promises"
            return chain(violation, "E16", CauseStep(at, text))
        text = f"{called(who)} proposed term {term.n} on promises for term {max(others)[1].n}"
        return chain(violation, "E6", CauseStep(max(others)[0], "promises came"), CauseStep(at, text))
    newcomer = watch.promise_of_a_newcomer(term)
    joint = propose.config.previous is not None
    if newcomer is not None and (joint or at > 2.0 * watch._bond_s):
        text = f"{called(newcomer[1])} promised, which had just started"
        return chain(violation, "E1", CauseStep(newcomer[0], text))
    dropped = watch.asked_before(term)
    if dropped is not None:
        text = f"{called(who)} had promises for term {dropped.n}, and asked for term {term.n}"
        return chain(violation, "E6", CauseStep(at, text))
    if not joint:
        text = f"{called(who)} proposed a config that is not joint with all that promised"
        return chain(violation, "E18", CauseStep(at, text))
    return chain(violation, "E18", CauseStep(at, f"{called(who)} proposed without a quorum that remembers"))


def _agreement(watch: RuleWatch, violation: Violation) -> BrokenRule | None:
    """I9: whether one of the two speaks another version of the messages, or holds another mission."""
    foreign = [member for member in watch.foreign if shown(member) in violation.text]
    if foreign:
        text = f"{called(foreign[0])} speaks a version of the messages that the others cannot read"
        return chain(violation, "E35", CauseStep(violation.at, text))
    return chain(violation, "E25", CauseStep(violation.at, "one acted on a message of another agreement"))


def _stop(watch: RuleWatch, violation: Violation) -> BrokenRule | None:
    """I10: what the gateway knew while it let the wheels turn."""
    robot, word = watch._turned
    at, acknowledged = watch._acknowledged.get(robot, (LONG_AGO, NO_STOP))
    step = CauseStep(at, f"the gateway of robot {robot} acknowledged stop {acknowledged.epoch}")
    if word.stand:
        text = f"it knew stop {word.epoch}, and let the wheels turn"
        return chain(violation, "E28", step, CauseStep(violation.at, text))
    began_s = watch._gateway_began.get(robot, LONG_AGO)
    if began_s > at:
        text = f"the gateway of robot {robot} started again, and did not stand until it knew"
        return chain(violation, "E30", step, CauseStep(began_s, text))
    text = f"it took the older resume {word.epoch} for the newest word"
    return chain(violation, "E29", step, CauseStep(violation.at, text))


def _roster(_: RuleWatch, violation: Violation) -> BrokenRule | None:
    rule = "E34" if violation.text.startswith("retired") else "E33"
    return chain(violation, rule)


_OF_WORDS: tuple[tuple[str, str], ...] = (
    ("released", "E4"),
    ("its lease of", "E7"),
    ("after the RELEASE", "E4"),
    ("has heard the RELEASE", "E4"),
    ("has given nothing above", "E3"),
    ("had come to term", "E1"),
    ("while it is shut", "E13"),
    ("ms ahead", "E12"),
    ("that it had said to refuse", "E11"),
    ("that no message can carry", "E26"),
    ("that no quorum has granted", "E10"),
    ("wrote the chain", "E8"),
    ("may not know of a stop", "E30"),
    ("which knows a stop", "E28"),
    ("which knows an older resume", "E29"),
    ("by its agent alone", "E30"),
    ("no operator has said anything new", "E31"),
)
"""Rules of the invariants I12 to I16, which see a broken rule at once: by what they say."""


def _word(watch: RuleWatch, violation: Violation) -> BrokenRule | None:
    """I12 to I16: the rule of what was said, and E7 if a lease had ended before its RELEASE."""
    own = [lease for lease in watch.log.leases if violation.text.startswith(f"{shown(lease.who)} released")]
    if own and own[-1].until_s <= violation.at + EARLY_S:
        text = f"the lease of {called(own[-1].who)} ended, and it did not say so"
        return chain(violation, "E7 E4", CauseStep(own[-1].until_s, text))
    rule = next((rule for part, rule in _OF_WORDS if part in violation.text), None)
    return None if rule is None else chain(violation, rule)


_BY_INVARIANT: dict[str, Callable[[RuleWatch, Violation], BrokenRule | None]] = {
    "I1": _exclusive,
    "I2": _always("E12", "a gateway obeyed what it must refuse: an old time, or a lower term"),
    "I4": _bond,
    "I6": _always("E17", "voters changed without the quorums of both sets"),
    "I7": _amnesiac,
    "I9": _agreement,
    "I10": _stop,
    "I11": _roster,
    "I12": _word,
    "I13": _word,
    "I14": _word,
    "I15": _word,
    "I16": _word,
}


def lines(broken: BrokenRule) -> list[str]:
    """Return the chain as plain sentences with times, the rule first."""
    steps = [f"  {step.at_s:9.4f} s  {step.text}" for step in broken.steps]
    names = " and so ".join(f"rule {rule}" for rule in broken.rules)
    return [f"{names} was broken (protocol/README.md):", *steps]
