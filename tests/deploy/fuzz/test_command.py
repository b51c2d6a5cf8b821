"""`lfa fuzz`: reproducible, sees planted bugs, shrinks, and refuses bad input in one line."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from lfa.deploy.analysis.verification.safety import OneBond
from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.schedules import ScheduledFault, draw, without
from lfa.deploy.fuzz.search.command import parse_seeds, so_far
from lfa.deploy.fuzz.search.searches import Tally, shrink
from lfa.protocol.errors import Refused
from lfa.protocol.lease.membership import first_config
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import Grant, Member, Propose, Term, Version
from lfa.protocol.mission import Mission


@pytest.mark.parametrize("start", range(0, 60, 20))
def test_schedules_keep_every_invariant(start: int) -> None:
    for seed in range(start, start + 20):
        assert play(draw(seed)).violations == [], f"reproduce: lfa fuzz --seed {seed} -v"


def test_one_seed_is_one_run_under_any_hash_seed() -> None:
    told = [
        subprocess.run(
            [sys.executable, "-c", "from lfa.deploy.fuzz.search.command import _one; _one(5, True)"],
            env={**os.environ, "PYTHONHASHSEED": number},
            capture_output=True,
            check=True,
        ).stdout
        for number in ("1", "2")
    ]
    assert told[0] == told[1]
    assert len(told[0].splitlines()) > 100


@pytest.mark.usefixtures("forgetful_voter")
def test_a_planted_bug_is_found_shrunk_and_still_fails() -> None:
    """A voter that forgets its bond: two leases within few seeds, and few faults are enough."""
    bad = next(seed for seed in range(50) if play(draw(seed)).violations)
    name = play(draw(bad)).violations[0].name
    small = shrink(draw(bad), name)
    assert len(small.faults) < len(draw(bad).faults)
    assert any(v.name == name for v in play(small).violations)


@pytest.mark.parametrize(("bars", "violations"), [(True, 0), (False, 1)])
def test_i4_a_fence_holds_though_its_gateway_starts_anew(bars: bool, violations: int) -> None:
    """A voter that slept adopts a term late, and the next at once: its first bond outlasts the shut start of the
    gateway, the lease that it was for does not (seed 15427).
    """
    checker, old, new, voter = OneBond(timing_of("std")), Member(2, 9), Member(5, 12), Member(4, 11)
    terms = Term(4, 2, 9), Term(5, 5, 12)
    for term, holder in zip(terms, (old, new), strict=True):
        checker.proposes(2.2, holder, Propose(term, first_config(Mission((1, 2, 4, 5))), 0, holder))
    if bars:
        checker.bars(2.5, old.id, terms[1])
    checker.gateway_starts(2.7, old.id, 3.0)
    for term in terms:
        checker.grants(2.74, voter, Grant(term, 0, Version(term, 0), 2.2), 3.05)
    assert len(checker.violations) == violations


def test_a_long_hunt_says_how_it_stands() -> None:
    tally = Tally(1500, 8000, {"kill": 20_000, "cut": 15_000}, {77: ["I1 at 3.2 s: two"], 9: ["L1 at 8.0 s: none"]})
    assert so_far(tally, 100_000, 90.0) == (
        "1500 of 100000 schedules (1000 a minute), 8000 elections, 35000 faults, 2 failed [9, 77]"
    )


def test_faults_can_be_left_out_one_by_one() -> None:
    schedule = draw(4)
    assert len(without(schedule, 0, 2).faults) == len(schedule.faults) - 2
    assert all(isinstance(fault, ScheduledFault) for fault in schedule.faults)


@pytest.mark.parametrize(("text", "seeds"), [("3", range(3)), ("5000..5002", range(5000, 5003))])
def test_seeds_are_a_number_or_a_range(text: str, seeds: range) -> None:
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "many", "-3", "0", "5..", "9..5", "1.5", "9" * 30])
def test_other_seeds_are_refused(text: str) -> None:
    with pytest.raises(Refused, match="--seeds"):
        parse_seeds(text)
