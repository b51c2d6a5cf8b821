"""A violation in a schedule names the rule that was broken, and how it came to it. All planted bugs: `make why`."""

from __future__ import annotations

import pytest

from lfa.deploy.analysis.causes import forbidden_acts
from lfa.deploy.analysis.causes.broken_rules import RuleWatch, lines
from lfa.deploy.analysis.causes.fact_log import FactLog
from lfa.deploy.analysis.causes.liveness_rules import found
from lfa.deploy.analysis.verification.checker import Violation
from lfa.deploy.fuzz import fault_injector
from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.schedules import draw
from lfa.protocol.lease.timing import Timing, timing_of
from lfa.protocol.messages.consensus import Config, Member, Term, Version
from tests.deploy.analysis.causes.planted_bugs import SHOWN, SHOWN_IN, named, search_of, shown_in
from tests.protocol.lease.planted import Bug

SHORT = (
    "check, pause, act: the age of stamps is not checked",
    "voters change without a joint config",
    "a hint taken as proof",
    "a bond of half the lease",
    "PREPARE and PROPOSE ignore a live grant",
    "a stop is not held",
    "an agent lifts a stop",
    "clocks 25 % wrong against an eps of 0.1 %",
    "the wall clock in lease arithmetic",
    "an earlier incarnation is dropped in silence",
    "a full house leaves out the spare that asks for it",
    "out of the chain after four silent heartbeats",
    "equal ranks: everybody stands at once",
    "lease counted from the grant, not from the asking",
    "a replaced life makes a full house",
    "any resume lets a gateway go that has just started",
    "a replayed order shows that an operator is there",
)
"""Bugs that the ordinary tests plant; those from the clocks on break L1, L2, L4, L1, L5, L6, L7, L1, and twice I16."""


@pytest.mark.parametrize("bug", [b for b in SHOWN if b.what in SHORT], ids=lambda bug: f"{bug.where}: {bug.what}")
def test_the_report_of_a_violation_names_the_planted_rule(bug: Bug) -> None:
    rule, seed = shown_in(bug)
    found = named(bug, seed)
    assert found is not None, f"lfa fuzz {search_of(bug).options}--seed {seed}, with the bug planted"
    assert rule in found.rules, "\n".join(lines(found))


def test_a_voter_that_took_a_vanished_token_as_proof_is_told_in_the_order_of_what_happened() -> None:
    hint = next(bug for bug in SHOWN if bug.what == "a hint taken as proof")
    found = named(hint, SHOWN_IN[hint.what][1])
    assert found is not None
    assert [step.at_s for step in found.steps] == sorted(step.at_s for step in found.steps)
    said = "\n".join(lines(found))
    assert said.startswith("rule E15 and so rule E3 was broken (protocol/README.md):")
    assert said.index("and was bound by it") < said.index("saw the token") < said.index("I4: ")


def test_a_schedule_without_a_violation_names_no_rule() -> None:
    assert play(draw(1)).broken is None


def test_l3_a_process_that_keeps_an_older_config_is_named() -> None:
    one, other = Member(1, 1), Member(2, 1)
    log = FactLog(timing_of("std"))
    log.names(0.0, (1, 2))
    for at, config in ((1.0, Version(Term(1, 1, 1))), (2.0, Version(Term(2, 1, 1)))):
        for member in (one, other) if at < 2.0 else (one,):
            log.lives(0.0, member)
            log.adopts(at, member, Config(config, (one, other), None, None, (one, other)))
    broken = found(log, Violation("L3", 8.0, "versions differed"))
    assert broken is not None
    assert broken.rules == ("E9",)
    assert broken.steps[0].text == "robot 2 took its last config, and no newer one"


@pytest.mark.parametrize("seed", [17, 28, 33, 110])
def test_acts_that_no_rule_forbids_name_none(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    watches: list[RuleWatch] = []

    def watched(timing: Timing) -> RuleWatch:
        watches.append(RuleWatch(timing))
        return watches[0]

    monkeypatch.setattr(fault_injector, "RuleWatch", watched)
    assert play(draw(seed)).violations == []
    invented = Violation("L5", 8.0, "invented")
    assert [finder(watches[0].log, invented) for finder in forbidden_acts.AGAINST] == [None] * len(
        forbidden_acts.AGAINST
    ), f"lfa fuzz --seed {seed}"
