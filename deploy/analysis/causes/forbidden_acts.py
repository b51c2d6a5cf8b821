"""Acts that a rule forbids, whatever they lead to: found in the log of a schedule, by what was observed."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from lfa.deploy.analysis.causes.fact_log import BrokenRule, CauseStep, FactLog, called, chain
from lfa.deploy.analysis.verification.checker import LONG_AGO, Violation
from lfa.protocol.incarnations import is_later
from lfa.protocol.lease.membership import team_of
from lfa.protocol.lease.timing import CLOCK_RATE_ERROR
from lfa.protocol.messages.consensus import Config, Member, Propose, Term
from lfa.protocol.names import WITNESS_ID

Finder = Callable[[FactLog, Violation], BrokenRule | None]

ROUNDING_S = 1e-3
TOLD_S = 1.0
"""Time [s] before a violation in which a word about incarnations counts, and in which a robot that drives is obeyed."""


def wrong_clock(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E2 counts on clocks that are never set and whose rates differ by eps: a process's own stamps tell."""
    for who, first in log.first_readings.items():
        last = log.last_readings[who]
        true_s, local_s = last.at_s - first.at_s, last.local_s - first.local_s
        allowed_s = log.timing.deadman_s + 2.0 * CLOCK_RATE_ERROR * true_s
        if abs(local_s - true_s) > allowed_s:
            text = f"by the clock of {called(who)} {local_s:.3f} s had passed in {true_s:.3f} s"
            return chain(violation, "E2", CauseStep(last.at_s, text))
    for who in log.living:
        stepped_s = log.wall_steps_s.get(who.id, LONG_AGO)
        if log.began[who] < stepped_s and log.heard_s[who] < stepped_s + 2.0 * log.timing.grant_s < violation.at - 1.0:
            text = f"the wall clock of {called(who)} was set, and it said nothing any more"
            return chain(violation, "E2", CauseStep(stepped_s, text))
    return None


def unasked_lease(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E2: a lease lasts T_act from the sending of a round that a quorum has granted, and not longer; or as long as
    that round has asked for (E36).
    """
    for lease in log.leases:
        asked_s = _granted_s(log, lease.who, lease.term, lease.at_s, lambda at, _: at)
        if asked_s is None:
            voters = sorted({voter.id for at, voter, _ in log.granted[lease.term] if at <= lease.at_s})
            text = f"{called(lease.who)} leads under term {lease.term.n}, which only {voters} have granted"
            return chain(violation, "E2", CauseStep(lease.at_s, text))
        until_s = _granted_s(log, lease.who, lease.term, lease.at_s, lambda at, propose: at + _lasts_s(log, propose))
        if until_s is not None and lease.until_s > until_s + ROUNDING_S:
            asked = CauseStep(asked_s, f"{called(lease.who)} asked for the round that a quorum granted last")
            text = f"it leads until {lease.until_s:.4f} s, {lease.until_s - asked_s:.3f} s after it asked"
            return chain(violation, "E2", asked, CauseStep(lease.at_s, text))
    return None


def _lasts_s(log: FactLog, propose: Propose) -> float:
    """Return the longest lease [s, true time] that goes with the bond which a round asks for."""
    act_s = log.timing.act_s
    if propose.grant_ms:
        slowest = (1.0 + CLOCK_RATE_ERROR) / (1.0 - CLOCK_RATE_ERROR)
        act_s = min(act_s, propose.grant_ms / 1000.0 / slowest - log.timing.deadman_s)
    return act_s / (1.0 - CLOCK_RATE_ERROR)


def _granted_s(
    log: FactLog, who: Member, term: Term, until_s: float, of_round: Callable[[float, Propose], float]
) -> float | None:
    """Return the latest time [s] that half of a config's voters have granted by `until_s`, of the times that `of_round`
    has for a round and its sending; None: there is none. The holder counts as one that grants.
    """
    sent = [(at, propose.round, of_round(at, propose)) for at, _, propose in log.proposed[term]]
    voted = {who: float("inf")}
    for at, voter, number in log.granted[term]:
        if at <= until_s and voter != who:
            granted_s = max((value for t, one, value in sent if one == number and t <= at), default=LONG_AGO)
            voted[voter] = max(voted.get(voter, LONG_AGO), granted_s)
    configs = {propose.config.version: propose.config for at, _, propose in log.proposed[term] if at <= until_s}
    times = [_half_s(config, voted) for config in configs.values()]
    return max((time for time in times if time > LONG_AGO), default=None)


def _half_s(config: Config, voted: dict[Member, float]) -> float:
    newest_first = sorted((voted.get(voter, LONG_AGO) for voter in config.voters), reverse=True)
    return newest_first[(len(newest_first) - 1) // 2] if newest_first else LONG_AGO


def proposed_without_quorum(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E18: only promises of incarnations that the config names make a quorum."""
    for term, proposals in log.proposed.items():
        at, who, propose = proposals[0]
        if propose.holder != who or (who.id, who.incarnation) != (term.issuer, term.incarnation):
            continue  # handed over (E16)
        promised = {member for t, member in log.promised[term] if t <= at} | {who}
        voters = propose.config.voters
        if 2 * sum(voter in promised for voter in voters) < len(voters):
            names = sorted(voter.id for voter in voters if voter not in promised)
            text = f"{called(who)} proposed term {term.n} without promises of the voters {names} that its config names"
            return chain(violation, "E18", CauseStep(at, text))
    return None


def counts_a_replaced_life(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E18: an incarnation of which a candidate has heard a later one makes no unanimous start."""
    for term, proposals in log.proposed.items():
        at, who, propose = proposals[0]
        if propose.holder != who or (who.id, who.incarnation) != (term.issuer, term.incarnation):
            continue  # handed over (E16)
        known = next((asked.known for asked in reversed(log.asked) if asked.term == term and asked.at_s <= at), None)
        for voter in sorted(set(propose.config.voters) - set(() if known is None else known.voters)):
            met_s = _later_met_s(log, who, voter)
            if met_s < at:
                heard = CauseStep(
                    met_s, f"{called(who)} heard a later incarnation of {called(voter)} than {voter.incarnation}"
                )
                text = f"it proposed term {term.n} with {voter.incarnation} as a voter, which grants nothing any more"
                return chain(violation, "E18", heard, CauseStep(at, text))
    return None


def _later_met_s(log: FactLog, who: Member, voter: Member) -> float:
    """Return the time [s] at which `who` first heard a later incarnation of `voter` that agrees with it; else inf."""
    return min(
        (
            at
            for other, at in log.met[who].items()
            if other.id == voter.id
            and is_later(other.incarnation, voter.incarnation)
            and log.agreed.get(other) == log.agreed.get(who)
        ),
        default=inf,
    )


def stands_and_may_not(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E33, E34: nobody stands whom its own config does not admit, or retires."""
    for asked in log.asked:
        if asked.known is None or asked.who.id == WITNESS_ID:
            continue
        roster = asked.known.roster
        if asked.who.id in roster.retired:
            text = f"{called(asked.who)} stands for election, and knew that it is retired"
            return chain(violation, "E34", CauseStep(asked.at_s, text))
        if asked.who.id not in team_of(roster, log.named):
            text = f"{called(asked.who)} stands for election, and nobody has admitted it"
            return chain(violation, "E33", CauseStep(asked.at_s, text))
    return None


def stranger_in_chain(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E33: a robot that is neither named by the mission nor admitted is in no chain."""
    if not log.strangers:
        return None
    at, who, stranger = log.strangers[0]
    text = f"{called(who)} has {called(stranger)} in its chain, which nobody has admitted"
    return chain(violation, "E33", CauseStep(at, text))


def wrongly_superseded(log: FactLog, violation: Violation) -> BrokenRule | None:
    """E23: the latest incarnation of a name is never told of a later one, and an earlier one always is."""
    since_s = max(log.healed_s, violation.at - TOLD_S)
    for at, who, number in log.called_superseded:
        for other in log.living if at >= since_s else ():
            if Member(other.id, number) in log.began and is_later(other.incarnation, number):
                text = f"{called(who)} told {called(other)}, incarnation {other.incarnation}, that {number} is later"
                return chain(violation, "E23", CauseStep(at, text))
    for one in log.living:
        obeyed = one in log.last_readings and log.last_readings[one].at_s > violation.at - TOLD_S
        later = [other for other in log.began if other.id == one.id and is_later(other.incarnation, one.incarnation)]
        if later and one.id != WITNESS_ID and not obeyed:
            text = f"{called(one)} runs as incarnation {one.incarnation}, earlier than {later[0].incarnation}"
            step = CauseStep(log.began[one], f"{text}, and nobody made it start anew")
            return chain(violation, "E23", step)
    return None


AGAINST: tuple[Finder, ...] = (
    wrong_clock,
    unasked_lease,
    proposed_without_quorum,
    counts_a_replaced_life,
    stands_and_may_not,
    stranger_in_chain,
    wrongly_superseded,
)
"""Finders of acts that a rule forbids, whatever they lead to."""
