"""In the profile auto rules of bonds and leases are broken by what rounds asked for, not by the longest durations."""

from __future__ import annotations

import pytest

from lfa.deploy.analysis.causes import forbidden_acts
from lfa.deploy.analysis.causes.broken_rules import RuleWatch
from lfa.deploy.analysis.verification.checker import Violation
from lfa.deploy.fuzz import fault_injector
from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.search.lagging import draw_lagging
from lfa.protocol.lease.timing import Timing, lengths_of, timing_of
from lfa.protocol.messages.consensus import Config, Grant, Member, Propose, Term, Version

AUTO = timing_of("auto")
SHORT = lengths_of(AUTO)[0]
SHORT_MS = round(1000.0 * SHORT.grant_s)
A, B, VOTER = Member(1, 1), Member(2, 1), Member(3, 1)
FIRST, NEXT = Term(1, 1, 1), Term(2, 2, 1)


def watch_of(*rounds: tuple[float, int], until_s: float) -> RuleWatch:
    """Return what is known after the voter has granted these rounds of `A` (time [s], bond [ms]), and then `B`."""
    watch = RuleWatch(AUTO)
    for number, (at, grant_ms) in enumerate(rounds):
        _granted(watch, at, FIRST, A, number, grant_ms)
    _granted(watch, until_s, NEXT, B, 0, 0)
    return watch


def _granted(watch: RuleWatch, at: float, term: Term, holder: Member, number: int, grant_ms: int) -> None:
    config = Config(Version(term), (A, B, VOTER), None, None, (A, B, VOTER))
    for log in (watch, watch.log):
        log.proposes(at, holder, Propose(term, config, number, holder, grant_ms=grant_ms))
        log.grants(at, VOTER, Grant(term, number, config.version, 0.0), at + AUTO.grant_s)


def rules_of_i1(watch: RuleWatch, at: float) -> tuple[str, ...]:
    watch.note(Violation("I1", at, "two lead"))
    [(_, broken)] = watch.broken_rules
    return () if broken is None else broken.rules


def test_two_grants_after_the_bond_that_was_asked_for_break_no_rule_of_bonds() -> None:
    legal_s = 1.0 + SHORT.grant_s + 0.001
    assert "E2" not in rules_of_i1(watch_of((1.0, SHORT_MS), until_s=legal_s), legal_s)


@pytest.mark.parametrize("grant_ms", [SHORT_MS, 0])
def test_two_grants_within_the_bond_that_was_asked_for_break_e2(grant_ms: int) -> None:
    early_s = 1.0 + 0.9 * (grant_ms / 1000.0 or AUTO.grant_s)
    assert rules_of_i1(watch_of((1.0, grant_ms), until_s=early_s), early_s) == ("E2",)


def test_a_shorter_round_ends_no_longer_bond_here_either() -> None:
    early_s = 1.1 + SHORT.grant_s + 0.1
    watch = watch_of((1.0, 0), (1.1, SHORT_MS), until_s=early_s)
    assert rules_of_i1(watch, early_s) == ("E2",)
    said = " ".join(step.text for _, broken in watch.broken_rules if broken for step in broken.steps)
    assert "it lasts 1.70" in said


@pytest.mark.parametrize(("longer_s", "breaks"), [(0.0, False), (0.1, True)])
def test_a_lease_lasts_as_long_as_its_round_asked_for_and_not_longer(longer_s: float, breaks: bool) -> None:
    watch = watch_of((1.0, SHORT_MS), until_s=9.0)
    watch.log.leads(1.01, A, FIRST, 1.0 + SHORT.act_s + longer_s)
    broken = forbidden_acts.unasked_lease(watch.log, Violation("L5", 8.0, "invented"))
    assert (broken is not None) == breaks


@pytest.mark.parametrize("seed", range(1, 9))
def test_no_lease_of_lagging_teams_outlasts_what_was_asked_for(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    watches: list[RuleWatch] = []

    def watched(timing: Timing) -> RuleWatch:
        watches.append(RuleWatch(timing))
        return watches[0]

    monkeypatch.setattr(fault_injector, "RuleWatch", watched)
    assert play(draw_lagging(seed)).violations == []
    assert watches[0].log.leases
    assert forbidden_acts.unasked_lease(watches[0].log, Violation("L5", 99.0, "invented")) is None
