"""The design's usual bugs and failed wordings that no test of a rule names: one directed scenario each."""

from __future__ import annotations

from typing import TypeVar

from lfa.protocol.lease.acceptor import Acceptor
from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.timing import CLOCK_RATE_ERROR
from lfa.protocol.messages.consensus import (
    Grant,
    Hello,
    LeaseBody,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Release,
    Term,
    Version,
)
from tests.rigs.lease_scenes import (
    HIGH,
    LOW,
    OLD,
    OTHERS,
    STD,
    TEAM,
    A,
    B,
    Team,
    alone,
    ask,
    config_of,
    elected,
    proposed,
    sent,
    voter,
)

Body = TypeVar("Body", bound=LeaseBody)
RATE_ERROR = CLOCK_RATE_ERROR
"""How wrong the clocks of `test_e2_leases_are_exclusive_on_the_worst_clocks` are."""


def overheard(team: Team, speaker: int, kind: type[Body]) -> list[tuple[float, Body]]:
    """All of that kind that `speaker` says from now on, and when."""
    said: list[tuple[float, Body]] = []

    def hear(source: int, _to: int, body: LeaseBody) -> float:
        if source == speaker and isinstance(body, kind):
            said.append((team.now, body))
        return 0.0

    team.filter = hear
    return said


def test_bug_3_a_stepped_wall_clock_changes_nothing() -> None:
    for by_s in (3600.0, -3600.0):
        team = Team()
        for host in team.ids:
            team.step_wall(host, by_s)
        team.run(3.0)
        assert team.changes() == []
        assert len([at for at, _ in team.accepted if at > 1.0]) > 90, "it commands 50 times a second"
        assert team.safe()


def test_bug_5_the_end_of_a_lease_is_told() -> None:
    team = Team()
    team.cut((1,))
    team.run(2.0)
    assert team.changes()[0] == (1, "StepDown")


def test_bug_11_a_leader_that_is_heard_and_hears_nothing_falls_silent() -> None:
    team = Team()
    team.part({(other, 1) for other in (0, 2, 3, 4)})
    said = overheard(team, 1, Propose)
    team.run(3.0)
    assert said[-1][0] <= 1.0 + STD.act_s, "its PROPOSEs would keep every voter bound"
    assert team.leaders() == [2]


def test_bug_12_many_that_stand_at_once_do_not_go_on_beating_each_other() -> None:
    """Nobody remembers a leader, and everybody asks at the same moment: the first in the chain leads at once."""
    for seed in range(5):
        team = Team(16, seed=seed)
        for robot_id in team.ids:
            team.kill(robot_id)
        for robot_id in team.ids:
            team.start(robot_id)
        team.run(1.0 + STD.grant_s + 0.05)
        assert team.leaders() == [1]


def test_e2_leases_are_exclusive_on_the_worst_clocks() -> None:
    """The leader's clock is the slowest and the voters' are the fastest that E2 allows for."""
    rates = {1: 1.0 - RATE_ERROR, -1: 1.0 - RATE_ERROR} | dict.fromkeys((0, 2, 3, 4), 1.0 + RATE_ERROR)
    team = Team(rates=rates)
    team.cut((1,))
    team.run(3.0)
    assert team.leaders() == [2]
    assert team.safe()


# --- wordings of the rules that failed (lease.md section 10) ---------------------------------------------------------


def test_e16_a_hand_over_leaves_the_config_as_it_is_version_included() -> None:
    """Who hands over has no phase 1 of the new term: a config that it wrote could undo one that a later term made."""
    team = Team()
    before = team.lease_of(1).config
    said = overheard(team, 1, Propose)
    team.hand_over(1)
    team.run(1.01)
    transfer_proposal = next(body for _, body in said if body.nonce is not None)
    assert transfer_proposal.config == before
    assert transfer_proposal.config.version.term < transfer_proposal.term


def test_e18_a_config_of_a_full_house_is_joint_with_all_of_it() -> None:
    lease = alone()
    propose = proposed(lease, STD.grant_s)
    previous = propose.config.previous
    assert previous is not None
    assert (previous.rule, set(previous.voters)) == ("all", {Member(1, 7), *OTHERS})
    effects = lease.receive(OTHERS[1], Grant(propose.term, 0, propose.config.version, 0.0), STD.grant_s + 0.001)
    assert not lease.may_command(STD.grant_s + 0.001), f"the witness has not accepted it: {effects}"


def test_e4_a_raised_term_that_is_given_up_releases_nothing() -> None:
    """Its voters' bonds are what keeps the old lease exclusive, and that one still runs."""
    lease, _, at, _ = elected(slow_s=0.001)
    old = lease.term
    [prepare] = sent(lease.gateway_term(Term(old.n + 5, 9, 9), at), Prepare)
    assert isinstance(prepare, Prepare)
    promises = [lease.receive(m, Promise(prepare.term, lease.config, None, False), at) for m in OTHERS]
    raised = [body for effects in promises for body in sent(effects, Propose)]
    assert len(raised) == 1, "the raised term is being asked for"
    beaten = Nack(prepare.term, Term(old.n + 9, 9, 9), None, 0.0, lease.config)
    effects = [effect for m in OTHERS for effect in lease.receive(m, beaten, at)]
    assert sent(effects, Release) == []
    assert lease.may_command(at)
    assert lease.term == old


def test_e10_until_a_quorum_has_granted_the_raised_term_it_acts_under_the_old_one() -> None:
    lease, _, at, _ = elected(slow_s=0.001)
    old = lease.term
    [prepare] = sent(lease.gateway_term(Term(old.n + 5, 9, 9), at), Prepare)
    assert isinstance(prepare, Prepare)
    assert lease.term == old
    for member in OTHERS:
        lease.receive(member, Promise(prepare.term, lease.config, None, False), at)
    assert lease.term == old, "asked for, not granted"
    lease.receive(OTHERS[0], Grant(prepare.term, 0, lease.config.version, 0.0), at)
    lease.receive(OTHERS[1], Grant(prepare.term, 0, lease.config.version, 0.0), at)
    assert lease.term == prepare.term


def test_e15_of_a_term_that_was_handed_over_the_holders_gateway_is_fenced_not_the_issuers() -> None:
    team = Team()
    team.hand_over(1)
    team.run(1.03)
    given = team.lease_of(2).term
    assert (team.leaders(), given.issuer) == ([2], 1)
    team.kill(2)
    team.run(1.2)
    assert team.leaders() == [3]
    assert team.gateways[2].gateway.term_max > given
    assert team.safe()


def test_e3_a_fence_of_a_later_term_frees_nobody_bound_to_an_earlier_one() -> None:
    """`fenced` is a set: the highest in it says nothing of the terms below, which other robots held."""
    bound = voter()
    ask(bound, A, LOW, 10.0)
    later = Term(LOW.n, 9, 9)
    propose = Propose(HIGH, config_of(HIGH), 0, B, fenced=(later,))
    assert later > LOW
    assert isinstance(bound.propose(B, propose, config_of(LOW), 10.1), Nack)


def test_rounds_of_a_term_go_on_where_its_issuer_stopped() -> None:
    """A round that was used twice would count old grants for a new question."""
    holder = Holder(A, Term(7, 2, 8), STD, 10.0, 1)
    holder.transferred(0, 9.9)
    assert [holder.next_propose(config_of(LOW), 10.0).round, holder.next_propose(config_of(LOW), 10.1).round] == [1, 2]


def test_a_refused_candidate_raises_no_promise_at_a_voter_without_a_bond_either() -> None:
    """Bug 10, at the voter: whoever comes back with an old config and a high term changes nothing."""
    free = Acceptor(Term(), STD.grant_s, 0.0)
    newer = config_of(HIGH, 3)
    assert isinstance(free.prepare(A, Prepare(Term(99, 1, 7), Version(LOW)), newer, 10.0), Nack)
    assert free.promised == Term()


def test_bug_10_a_candidate_that_nobody_hears_keeps_its_term() -> None:
    team = Team()
    team.cut((3,))
    said = overheard(team, 3, Prepare)
    team.run(11.0)
    assert len(said) > 100
    assert len({body.term for _, body in said}) == 1


# --- a candidate whose grants are on their way, refused by one voter of five (E6) -------------------------------------

REFUSED_AT = 1.0


def refused_by_the_witness(
    restarted: tuple[int, ...], vanished: tuple[int, ...], granted: tuple[int, ...] = ()
) -> Lease:
    """Robot 2 of four, after robot 1 fell silent and `granted` have granted to it; three votes of five are needed."""
    lease = Lease(Member(2, 1), TEAM, STD, 0.0, floor=0)
    lease.receive(
        Member(1, 1), Propose(Term(1, 1, 1), config_of(Term(1, 1, 1)), 0, Member(1, 1), agreed=lease.agreed), 0.4
    )
    [prepare] = sent(lease.tick(REFUSED_AT), Prepare)
    assert isinstance(prepare, Prepare)
    promise = Promise(prepare.term, lease.config, None, False)
    effects = [e for other in (0, 4) for e in lease.receive(Member(other, 1), promise, REFUSED_AT)]
    [propose] = sent(effects, Propose)
    assert isinstance(propose, Propose)
    for other in granted:
        lease.receive(Member(other, 1), Grant(propose.term, propose.round, propose.config.version, 0.0), REFUSED_AT)
    for other in restarted:
        lease.receive(Member(other, 2), Hello(None, lease.agreed), REFUSED_AT)
    for other in vanished:
        lease.hint(other, 1, False, REFUSED_AT)
    lease.receive(Member(0, 1), Nack(propose.term, Term(50, 4, 1), None, 0.0, OLD), REFUSED_AT)
    return lease


def asks_anew(lease: Lease) -> bool:
    """With a term above the refusal, long before the attempt runs out."""
    said = sent(lease.tick(REFUSED_AT + STD.heartbeat_s), Prepare)
    return any(isinstance(body, Prepare) and body.term > Term(50, 4, 1) for body in said)


def test_e6_an_attempt_that_only_ended_lives_could_still_grant_is_given_up_at_once() -> None:
    """Else it binds its own voter for T_act against whoever the others have promised to (L1)."""
    assert asks_anew(refused_by_the_witness(restarted=(1, 3), vanished=()))
    assert asks_anew(refused_by_the_witness(restarted=(), vanished=(1, 3)))
    assert asks_anew(refused_by_the_witness(restarted=(1,), vanished=(3,)))


def test_e6_one_refusal_undoes_no_attempt_that_a_quorum_may_still_grant() -> None:
    assert not asks_anew(refused_by_the_witness(restarted=(), vanished=()))
    assert not asks_anew(refused_by_the_witness(restarted=(1,), vanished=()))
    assert not asks_anew(refused_by_the_witness(restarted=(1, 3), vanished=(), granted=(3,))), "its grant still counts"
