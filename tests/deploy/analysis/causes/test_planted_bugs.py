"""A violation in a schedule names the rule that was broken, and how it came to it. All planted bugs: `make why`."""

from __future__ import annotations

import pytest

from lfa.deploy.analysis.causes.broken_rules import lines
from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.schedules import draw
from tests.deploy.analysis.causes.planted_bugs import SHOWN, SHOWN_IN, named
from tests.protocol.lease.planted import Bug

SHORT = ("E2", "E3", "E12", "E15", "E17", "E28")
"""Rules of the bugs that the ordinary tests plant."""


@pytest.mark.parametrize(
    "bug", [bug for bug in SHOWN if SHOWN_IN[bug.what][0] in SHORT], ids=lambda bug: f"{bug.where}: {bug.what}"
)
def test_the_report_of_a_violation_names_the_planted_rule(bug: Bug) -> None:
    rule, seed = SHOWN_IN[bug.what]
    found = named(bug, seed)
    assert found is not None, f"lfa fuzz --seed {seed}, with the bug planted"
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
