"""The checkers of leases and of what gateways obey notice each breach of I1, I2 and I8 at its bound, none beside it."""

from __future__ import annotations

import pytest

from lfa.deploy.analysis.verification.checker import EARLY_S
from lfa.deploy.analysis.verification.safety import (
    Acting,
    LeaseExclusivity,
    Residual,
)
from lfa.protocol.lease.timing import CLOCK_RATE_ERROR
from lfa.protocol.messages.consensus import (
    Term,
)
from tests.rigs.lease_facts import HIGH, LOW, MIDDLE, ONE, STD, THREE, TWO, command, config, found

# I1


@pytest.mark.parametrize(("at", "broken"), [(0.9, 1), (1.0, 0), (1.1, 0)])
def test_i1_two_leases_may_meet_and_not_overlap(at: float, broken: int) -> None:
    checker = LeaseExclusivity(STD)
    checker.leads(0.0, ONE, LOW, 1.0)
    checker.leads(0.1, ONE, LOW, 1.0)
    assert found(checker) == 0
    checker.leads(at, TWO, MIDDLE, at + 1.0)
    assert found(checker) == broken


def test_i1_a_lease_may_overlap_one_of_a_lower_term_that_is_fenced_and_no_other() -> None:
    for fenced, broken in ((ONE, 0), (TWO, 1)):
        checker = LeaseExclusivity(STD)
        checker.bars(0.0, fenced.id, MIDDLE)
        checker.leads(0.0, ONE, LOW, 1.0)
        checker.leads(0.5, TWO, MIDDLE, 1.5)
        assert found(checker) == broken
        checker.leads(0.6, ONE, LOW, 1.6)  # whoever of the two is heard last
        assert found(checker) == 2 * broken


def test_i1_who_steps_down_or_has_run_out_is_forgotten() -> None:
    checker = LeaseExclusivity(STD)
    checker.leads(0.0, ONE, LOW, 1.0)
    checker.leads_no_more(0.5, ONE)
    checker.leads(0.6, TWO, MIDDLE, 0.9)
    checker.leads(1.0, THREE, HIGH, 2.0)
    checker.leads(0.5, THREE, HIGH, 2.0)  # an earlier time, as if: nobody else is valid any more
    assert found(checker) == 0


# I2


def test_i2_a_gateway_obeys_no_lower_term_until_it_restarts() -> None:
    checker = Acting(STD)
    checker.obeys(0.0, 1, command(MIDDLE, 2, as_leader=False), 0.0)
    checker.obeys(0.1, 3, command(LOW, 1, as_leader=False), 0.0)
    checker.obeys(0.1, 1, command(MIDDLE, 2, as_leader=False), 0.0)
    assert found(checker) == 0
    checker.obeys(0.2, 1, command(LOW, 1, as_leader=False), 0.0)
    assert found(checker) == 1
    checker.obeys(0.3, 1, command(LOW, 1, as_leader=False), 0.0)
    assert found(checker) == 1
    checker.obeys(0.4, 1, command(MIDDLE, 2, as_leader=False), 0.0)
    checker.gateway_starts(0.5, 1, 0.0)
    checker.obeys(0.6, 1, command(LOW, 1, as_leader=False), 0.0)
    assert found(checker) == 1


@pytest.mark.parametrize(("older_s", "broken"), [(0.0, 0), (0.5 * EARLY_S, 0), (2.0 * EARLY_S, 1)])
def test_i2_a_command_is_no_older_than_the_deadman(older_s: float, broken: int) -> None:
    checker = Acting(STD)
    checker.obeys(1.0, 1, command(LOW, 1), STD.deadman_s + older_s)
    assert found(checker) == broken


def test_i2_a_term_has_one_holder() -> None:
    checker = Acting(STD)
    for holder, broken in ((1, 0), (1, 0), (2, 1)):
        checker.obeys(0.0, holder, command(LOW, holder, as_leader=False), 0.0)
        assert found(checker) == broken


def test_i2_only_its_own_gateway_obeys_a_leader() -> None:
    checker = Acting(STD)
    checker.obeys(0.0, 2, command(LOW, 1, as_leader=False), 0.0)
    assert found(checker) == 0
    checker.obeys(0.0, 2, command(LOW, 1), 0.0)
    assert found(checker) == 1


def obeyed(*terms: Term) -> Acting:
    checker = Acting(STD)
    for term in terms:
        checker.obeys(0.0, term.issuer, command(term, term.issuer), 0.0)
    return checker


def test_i2_terms_of_leaders_never_decrease() -> None:
    assert found(obeyed(LOW, MIDDLE, MIDDLE, HIGH)) == 0
    assert found(obeyed(LOW, HIGH, MIDDLE)) == 1
    assert found(obeyed(MIDDLE, LOW, HIGH, MIDDLE)) == 2


def test_i2_terms_may_begin_anew_only_where_a_wall_clock_was_set_and_nobody_remembers() -> None:
    for stepped, remembers, broken in ((True, False, 0), (False, False, 1), (True, True, 1)):
        checker = obeyed(HIGH)
        for who in (ONE, TWO):
            checker.adopts(0.0, who, config())
        if stepped:
            checker.wall_steps(0.5, 1)
        checker.ends(1.0, ONE)
        if not remembers:
            checker.ends(1.0, TWO)
        checker.obeys(2.0, LOW.issuer, command(LOW, LOW.issuer), 0.0)
        assert found(checker) == broken


# I8


def led(at: float, term: Term = MIDDLE, *, age: float = 0.0, as_leader: bool = True) -> Residual:
    """Robot 1 is obeyed at 10 s, as leader or not, by a command of this age; the next holder at `at`."""
    checker = Residual(STD)
    checker.obeys(10.0, 1, command(LOW, 1, as_leader=as_leader), age)
    checker.obeys(at, term.issuer, command(term, term.issuer), 0.0)
    return checker


REST_S = STD.deadman_s / (1.0 + CLOCK_RATE_ERROR)


def test_i8_the_next_leader_waits_for_the_deadman_after_the_stamp_of_the_last_command() -> None:
    assert found(led(10.0 + REST_S)) == 0
    assert found(led(10.0 + REST_S - 2.0 * EARLY_S)) == 1
    assert found(led(10.0 + REST_S - 0.01, age=0.01)) == 0
    assert found(led(10.0 + REST_S - 0.01 - 2.0 * EARLY_S, age=0.01)) == 1
    assert "obeyed 10.0 ms before" in led(10.0 + REST_S - 0.01 - EARLY_S).violations[0].text
    assert found(led(10.0, as_leader=False)) == 0
    assert found(led(10.0, Term(2, 1, 1))) == 0


def test_i8_or_for_a_fence() -> None:
    for robot, broken in ((1, 0), (2, 1)):
        checker = Residual(STD)
        checker.obeys(10.0, 1, command(LOW, 1), 0.0)
        checker.bars(10.0, robot, MIDDLE)
        checker.obeys(10.0, 2, command(MIDDLE, 2), 0.0)
        assert found(checker) == broken


def test_i8_commands_of_followers_do_not_count() -> None:
    checker = Residual(STD)
    checker.obeys(10.0, 1, command(LOW, 1), 0.0)
    checker.obeys(10.0, 2, command(MIDDLE, 2, as_leader=False), 0.0)
    assert found(checker) == 0
