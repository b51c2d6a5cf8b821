"""Which rule was broken when the team does not lead, gather or stop as it must (I8, L1 to L7), by what was observed.

Each finder looks through the log of the schedule for one act that a rule forbids, or for one that it demands and that
did not come. The finders of an invariant are tried in order: what a process did against a rule before what is missing.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from lfa.deploy.analysis.causes.fact_log import BrokenRule, CauseStep, FactLog, called, chain
from lfa.deploy.analysis.causes.forbidden_acts import AGAINST, Finder
from lfa.deploy.analysis.verification.checker import LONG_AGO, Violation
from lfa.protocol.lease.membership import ids, team_of
from lfa.protocol.messages.consensus import Member, Term

STUCK_TRIES = 5
"""Least number of a candidate's PREPAREs under one term for which all promises had come."""


def found(log: FactLog, violation: Violation) -> BrokenRule | None:
    """Return the rule that a violation of I8 or L1 to L7 shows to be broken; None if no act in the log tells."""
    for finder in _FINDERS.get(violation.name, ()):
        rule = finder(log, violation)
        if rule is not None:
            return rule
    return None


# --- what a rule demands, and did not come ---------------------------------------------------------------------------


def never_proposes(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E18: a candidate that has the promises of all proposes; with a spare, also E33."""
    by_term: dict[Term, list[float]] = {}
    for asked in log.asked:
        if asked.at_s >= log.healed_s:
            by_term.setdefault(asked.term, []).append(asked.at_s)
    for term, times in by_term.items():
        promised = {member for _, member in log.promised[term]} | {Member(term.issuer, term.incarnation)}
        if term not in log.proposed and len(times) >= STUCK_TRIES and promised >= set(log.living):
            text = f"robot {term.issuer} has the promises of all for term {term.n}, and proposes nothing"
            rules = "E18" if term.issuer in log.named else "E33 E18"
            return chain(violation, rules, CauseStep(times[-1], text))
    return None


def term_below_a_gateway(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E10, E24: a leader raises its term above what the gateways of its chain have seen."""
    if log.newest is None or not log.leases:
        return None
    leads = log.leases[-1]
    for member in log.newest.chain:
        at, below = log.barred.get(member.id, (LONG_AGO, leads.term))
        if below > leads.term and leads.at_s - at > log.timing.grant_s:
            text = f"the gateway of {called(member)} refuses terms up to {below.n}"
            goes_on = CauseStep(leads.at_s, f"{called(leads.who)} leads under term {leads.term.n}, and raised it not")
            return chain(violation, "E10" if member == leads.who else "E24 E10", CauseStep(at, text), goes_on)
    return None


def dead_in_chain(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E8: the leader closes the chain over a robot that is gone."""
    for member in () if log.newest is None else log.newest.chain:
        if member in log.ended:
            text = f"{called(member)} ended, and the chain was not closed over it"
            return chain(violation, "E8", CauseStep(log.ended[member], text))
    return None


def missing_in_chain(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E9: who is in no chain says HELLO, and is taken in at the tail."""
    newest = log.newest
    if newest is None or not newest.chain:
        return None
    for member in log.living:
        if member.id in team_of(newest.roster, log.named) and member not in newest.chain:
            text = f"{called(member)} runs, and is not taken into the chain {list(ids(newest.chain))}"
            return chain(violation, "E9", CauseStep(log.began[member], text))
    return None


def retired_voter(_: FactLog, violation: Violation) -> BrokenRule | None:
    """E34: a retired robot loses its vote."""
    return chain(violation, "E34") if violation.text.startswith("retired") else None


def one_config_a_term(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E9: who knows an older config than its leader's takes the newer one."""
    newest = log.newest
    if newest is None:
        return None
    for member in log.living:
        at, known = log.configs.get(member, (log.began[member], None))
        if known is None or known.version < newest.version:
            return chain(violation, "E9", CauseStep(at, f"{called(member)} took its last config, and no newer one"))
    return None


# --- who leads after whom --------------------------------------------------------------------------------------------


def released_too_early(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E4, E15: before another acts, the holder's gateway refuses its term, or its last command is old."""
    term = log.leases[-1].term if log.leases else None
    fenced = () if term is None or term not in log.proposed else log.proposed[term][0][2].fenced
    if fenced:
        return chain(violation, "E15", CauseStep(violation.at, "its holder's gateway had not been fenced"))
    return chain(violation, "E4", CauseStep(violation.at, "the bonds of the term before had been ended too early"))


def calm_leader_changed(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E8 and E2 keep a leader and its chain where only messages are lost."""
    if "closed the chain" in violation.text:
        text = f"nobody is silent for {log.timing.chain_silence_s:g} s at this loss"
        return chain(violation, "E8", CauseStep(violation.at, text))
    term = log.leases[-1].term
    sent = [at for at, _, _ in log.proposed[term] if at <= violation.at][-4:]
    gaps = [round(later - earlier, 3) for earlier, later in pairwise(sent)]
    text = f"the holder asked again after {gaps} s, and no quorum had granted"
    return chain(violation, "E2", CauseStep(sent[-1] if sent else violation.at, text))


def not_in_rank_order(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E6: candidates stand one after the other, by their places in the chain."""
    newest = log.leases[-1].at_s if log.leases else violation.at
    steps = [
        CauseStep(asked.at_s, f"{called(asked.who)} stands for election")
        for asked in log.asked
        if newest - log.timing.grant_s <= asked.at_s <= violation.at
    ]
    return chain(violation, "E6", *_once(steps))


def acts_after_its_lease(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E7: a leader whose lease has expired stops before all else."""
    if not log.leases or log.leases[-1].until_s > violation.at - log.timing.deadman_s:
        return None
    last = log.leases[-1]
    return chain(violation, "E7", CauseStep(last.until_s, f"the last lease, of {called(last.who)}, ended"))


def _once(steps: Iterable[CauseStep]) -> list[CauseStep]:
    """Return the first step of each text."""
    first: dict[str, CauseStep] = {}
    for step in steps:
        first.setdefault(step.text, step)
    return list(first.values())


_FINDERS: dict[str, tuple[Finder, ...]] = {
    "I8": (*AGAINST, released_too_early),
    "L1": (*AGAINST, never_proposes, term_below_a_gateway),
    "L2": (*AGAINST, retired_voter, never_proposes, dead_in_chain, missing_in_chain),
    "L3": (*AGAINST, never_proposes, one_config_a_term),
    "L4": (*AGAINST, never_proposes, term_below_a_gateway, dead_in_chain, missing_in_chain),
    "L5": (*AGAINST, calm_leader_changed),
    "L6": (*AGAINST, not_in_rank_order),
    "L7": (*AGAINST, acts_after_its_lease),
}
