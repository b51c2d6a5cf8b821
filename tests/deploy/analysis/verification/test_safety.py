"""The checkers of I1 to I11 notice each breach that they are for, at its bound, and nothing beside it."""

from __future__ import annotations

from typing import Any

import pytest

from lfa.deploy.analysis.verification.checker import EARLY_S, Checker
from lfa.deploy.analysis.verification.lease_observer import report_effect
from lfa.deploy.analysis.verification.safety import (
    Acting,
    JointChange,
    LeaseExclusivity,
    NoAmnesiacVote,
    OneAgreement,
    OneBond,
    OneChain,
    OneHolder,
    Residual,
    RosterHolds,
)
from lfa.protocol.geometry import STILL
from lfa.protocol.lease.effects import Send
from lfa.protocol.lease.timing import CLOCK_RATE_ERROR, timing_of
from lfa.protocol.messages.consensus import (
    Config,
    Electorate,
    GatewayStamp,
    Grant,
    Member,
    Promise,
    Propose,
    Roster,
    Spare,
    Term,
    Version,
)
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel

STD = timing_of("std")
ONE, TWO, THREE, FOUR = (Member(n, 1) for n in (1, 2, 3, 4))
LOW, MIDDLE, HIGH = Term(1, 1, 1), Term(2, 2, 1), Term(3, 3, 1)
TEAM = (ONE, TWO, THREE)
NOTHING = Roster()


def config(
    term: Term = LOW,
    seq: int = 0,
    voters: tuple[Member, ...] = TEAM,
    previous: Electorate | None = None,
    *,
    tie: Member | None = None,
    chain: tuple[Member, ...] = TEAM,
    roster: Roster = NOTHING,
) -> Config:
    return Config(Version(term, seq), voters, tie, previous, chain, roster)


def command(term: Term, holder: int, *, as_leader: bool = True) -> CmdVel:
    return CmdVel(Header(f"robot{holder}", 1, 1, 0.0), STILL, term, holder, as_leader, GatewayStamp(1, 0.0))


def propose(term: Term, holder: Member, round_number: int = 0, conf: Config | None = None) -> Propose:
    return Propose(term, conf or config(term), round_number, holder)


def grant(term: Term, seq: int = 0) -> Grant:
    return Grant(term, 0, Version(term, seq), 0.0)


def found(checker: Checker) -> int:
    return len(checker.violations)


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


# I3


def test_i3_a_term_is_held_by_one_and_proposed_by_it_or_its_issuer() -> None:
    checker = OneHolder(STD)
    checker.proposes(0.0, ONE, propose(LOW, ONE))
    checker.proposes(0.0, ONE, propose(LOW, ONE))
    checker.proposes(0.0, TWO, propose(MIDDLE, THREE))  # hands over
    checker.proposes(0.0, THREE, propose(MIDDLE, THREE))
    assert found(checker) == 0
    checker.proposes(0.0, ONE, propose(LOW, TWO))
    assert found(checker) == 1
    checker.proposes(0.0, FOUR, propose(MIDDLE, THREE))
    assert found(checker) == 2
    checker.proposes(0.0, Member(2, 2), propose(MIDDLE, THREE))
    assert found(checker) == 3


# I4


def bonds(until: float = 1.0) -> OneBond:
    """Voter 3 is bound to robot 1 by a low term."""
    checker = OneBond(STD)
    checker.proposes(0.0, ONE, propose(LOW, ONE))
    checker.proposes(0.0, TWO, propose(MIDDLE, TWO))
    checker.grants(0.0, THREE, grant(LOW), until)
    return checker


@pytest.mark.parametrize(("at", "broken"), [(0.9, 1), (1.0, 0), (1.1, 0)])
def test_i4_a_bond_lasts_until_it_ends(at: float, broken: int) -> None:
    checker = bonds()
    checker.grants(at, THREE, grant(MIDDLE), 2.0)
    assert found(checker) == broken


def test_i4_the_last_bond_counts_and_the_same_holder_may_be_granted_again() -> None:
    checker = bonds()
    checker.grants(0.9, THREE, grant(LOW), 1.9)
    assert found(checker) == 0
    checker.grants(1.5, THREE, grant(MIDDLE), 2.5)
    assert found(checker) == 1


@pytest.mark.parametrize(("apart_s", "broken"), [(STD.grant_s - 0.1, 1), (STD.grant_s + 0.1, 0)])
def test_i4_a_process_that_wakes_up_late_is_bound_from_the_arrival_of_what_it_grants(
    apart_s: float, broken: int
) -> None:
    """It takes both proposals at 5 s; they had arrived `apart_s` apart, and by the second the first's bond was over."""
    checker, woke_at = OneBond(STD), 5.0
    first_at, second_at = woke_at - apart_s, woke_at
    checker.proposes(first_at, ONE, propose(LOW, ONE))
    checker.proposes(second_at, TWO, propose(MIDDLE, TWO))

    def report(fact: Any, *arguments: Any) -> None:
        getattr(checker, fact.__name__)(*arguments)

    for term, arrived_at in ((LOW, first_at), (MIDDLE, second_at)):
        report_effect(report, Send("robot1", grant(term)), THREE, woke_at, arrived_at + STD.grant_s, float)
    assert found(checker) == broken


def test_i4_a_release_frees_the_voters_of_its_term() -> None:
    for term, broken in ((LOW, 0), (MIDDLE, 1)):
        checker = bonds()
        checker.releases(0.4, term)
        checker.grants(0.5, THREE, grant(MIDDLE), 1.5)
        assert found(checker) == broken


def test_i4_a_hand_over_frees() -> None:
    gift = Term(2, 1, 1)  # issued by the one to whom the voter is bound
    checker = bonds()
    checker.proposes(0.4, ONE, propose(gift, TWO))
    checker.grants(0.5, THREE, grant(gift), 1.5)
    assert found(checker) == 0
    checker = bonds()
    checker.proposes(0.4, ONE, propose(gift, THREE))  # the voter is the receiver: its own grant is not seen
    checker.grants(0.5, THREE, grant(MIDDLE), 1.5)
    assert found(checker) == 0
    checker = bonds()
    other_life = Term(2, 1, 2)
    checker.proposes(0.4, Member(1, 2), propose(other_life, TWO))
    checker.grants(0.5, THREE, grant(other_life), 1.5)
    assert found(checker) == 1


def test_i4_a_fence_frees_also_one_of_an_earlier_life_of_the_gateway() -> None:
    for robot, restarts, broken in ((1, False, 0), (1, True, 0), (2, False, 1)):
        checker = bonds()
        checker.bars(0.3, robot, MIDDLE)
        if restarts:
            checker.gateway_starts(0.4, robot, 0.0)
        checker.grants(0.5, THREE, grant(MIDDLE), 1.5)
        assert found(checker) == broken
    checker = bonds()
    checker.gateway_starts(0.4, 1, 1.0)  # shut until the bond ends
    checker.grants(0.5, THREE, grant(MIDDLE), 1.5)
    assert found(checker) == 0


# I5


def test_i5_a_version_is_one_config_and_grows() -> None:
    checker = OneChain(STD)
    checker.adopts(0.0, ONE, config())
    checker.adopts(0.0, TWO, config())
    checker.adopts(0.0, ONE, config(seq=1))
    assert found(checker) == 0
    checker.adopts(0.0, ONE, config(seq=1))
    assert found(checker) == 1
    checker.adopts(0.0, THREE, config(seq=1, chain=(TWO,)))
    assert found(checker) == 2
    checker.adopts(0.0, ONE, config())
    assert found(checker) == 3


def test_i5_who_leads_is_first_in_the_chain_that_it_knows() -> None:
    checker = OneChain(STD)
    checker.leads(0.0, ONE, LOW, 1.0)
    assert found(checker) == 1
    checker.adopts(0.0, ONE, config())
    checker.leads(0.0, ONE, LOW, 1.0)
    assert found(checker) == 1
    checker.adopts(0.0, ONE, config(seq=1, chain=(TWO, ONE)))
    checker.leads(0.0, ONE, LOW, 1.0)
    assert found(checker) == 2
    checker.adopts(0.0, ONE, config(seq=2, chain=()))
    checker.leads(0.0, ONE, LOW, 1.0)
    assert found(checker) == 3


# I6

OLD = Electorate(TEAM)
NEW = (*TEAM, FOUR)


def changed(*configs: Config, accepted: tuple[tuple[Member, int], ...] = ()) -> JointChange:
    checker = JointChange(STD)
    checker.adopts(0.0, ONE, config())
    for conf in configs:
        checker.adopts(0.0, ONE, conf)
        for who, seq in accepted if conf.previous is not None else ():
            checker.grants(0.0, who, grant(LOW, seq), 1.0)
    return checker


BY_BOTH = ((ONE, 1), (TWO, 1), (THREE, 1))


def test_i6_voters_change_by_a_joint_config_that_both_sets_accept() -> None:
    joint, end = config(seq=1, voters=NEW, previous=OLD), config(seq=2, voters=NEW)
    assert found(changed(joint, end, accepted=BY_BOTH)) == 0
    assert found(changed(joint, joint, end, end, accepted=BY_BOTH)) == 0
    assert found(changed(joint, end, accepted=((ONE, 1), (FOUR, 1)))) == 1
    assert found(changed(joint, end, accepted=((ONE, 1), (TWO, 1), (THREE, 0)))) == 1
    assert found(changed(joint, end, accepted=(*BY_BOTH, (THREE, 0)))) == 0  # an older grant takes nothing back


def test_i6_other_voters_need_a_joint_config_that_names_those_before() -> None:
    assert found(changed(config(seq=1, voters=NEW))) == 1
    assert found(changed(config(seq=1, tie=ONE))) == 1
    assert found(changed(config(seq=1, voters=NEW, previous=Electorate(TEAM, ONE)))) == 1
    joint = config(seq=1, voters=NEW, previous=OLD)
    assert found(changed(joint, config(seq=2, voters=TEAM, previous=Electorate(NEW)), accepted=BY_BOTH)) == 1
    assert found(changed(config(seq=1, previous=OLD))) == 1  # joint with the same voters


def test_i6_only_neighbours_are_compared_and_the_same_voters_go_on() -> None:
    assert found(changed(config(seq=2, voters=NEW))) == 0
    assert found(changed(config(seq=1, chain=(ONE,)))) == 0


# I7


def proposed(*promised: tuple[Member, bool], conf: Config | None = None, round_number: int = 0) -> int:
    checker = NoAmnesiacVote(STD)
    for who, blank in promised:
        checker.promises(0.0, who, Promise(LOW, config(), None, blank))
    checker.proposes(0.0, ONE, propose(LOW, ONE, round_number, conf))
    return found(checker)


def test_i7_a_term_rests_on_a_quorum_that_remembers() -> None:
    assert proposed((TWO, False)) == 0  # with its own
    assert proposed() == 1
    assert proposed((TWO, True), (THREE, True)) == 1


def test_i7_or_on_promises_of_everybody() -> None:
    everybody = config(previous=Electorate(TEAM, None, "all"))
    assert proposed((TWO, True), (THREE, True), conf=everybody) == 0
    assert proposed((TWO, True), conf=everybody) == 1
    assert proposed((TWO, True), (THREE, True), conf=config(previous=OLD)) == 1


def test_i7_is_asked_of_the_first_proposal_of_a_term_alone() -> None:
    assert proposed(round_number=1) == 0
    assert proposed(conf=config(seq=1)) == 0


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


# I9


def test_i9_votes_join_those_who_agree() -> None:
    for other, broken in ((7, 0), (8, 1)):
        checker = OneAgreement(STD)
        checker.holds(0.0, ONE, 7)
        checker.holds(0.0, TWO, other)
        checker.promises(0.0, TWO, Promise(LOW, config(), None, blank=False))
        assert found(checker) == broken
        checker.grants(0.0, TWO, grant(LOW), 1.0)
        assert found(checker) == broken  # of whom the term is, is not known yet
        checker.proposes(0.0, ONE, propose(LOW, ONE))
        checker.grants(0.0, TWO, grant(LOW), 1.0)
        assert found(checker) == 2 * broken
        checker.promises(0.0, TWO, Promise(HIGH, config(), None, blank=False))
        assert found(checker) == 2 * broken  # what robot 3 holds is not known


# I11


def test_i11_a_retired_robot_is_in_no_chain() -> None:
    for chain, broken in ((TEAM, 1), ((ONE, THREE), 0)):
        checker = RosterHolds(STD)
        checker.adopts(0.0, ONE, config(chain=chain, roster=Roster((), (2,))))
        assert found(checker) == broken


def test_i11_spares_are_fewer_than_the_other_voters() -> None:
    for voters, broken in ((TEAM, 0), ((ONE, THREE), 1), ((ONE, TWO), 0), ((THREE,), 1)):
        checker = RosterHolds(STD)
        checker.adopts(0.0, ONE, config(voters=voters, roster=Roster((Spare(3),))))
        assert found(checker) == broken
    checker = RosterHolds(STD)
    checker.adopts(0.0, ONE, config(voters=NEW, roster=Roster((Spare(3), Spare(4)))))
    assert found(checker) == 1
