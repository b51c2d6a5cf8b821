"""A lease of robot 1 of two that leads: what one input, or one round, changes of its term, its chain and its memory."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from lfa.protocol.lease.effects import BecomeLeader, Effect, Send, StepDown
from lfa.protocol.lease.machine import leadership
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.reconfiguration import reshaped
from lfa.protocol.messages.consensus import (
    Config,
    Grant,
    Hello,
    Member,
    Nack,
    Prepare,
    Propose,
    Roster,
    Spare,
    Superseded,
    Term,
    Version,
)
from tests.rigs.lease_scenes import ME, OTHER, OTHERS, STD, TRIO, TWO, WITNESS, committed, sent


def granted_by_all(lease: Lease, effects: list[Effect], at: float) -> list[Effect]:
    """Let both others grant the newest PROPOSE of `effects`; return what follows."""
    propose = sent(effects, Propose)[-1]
    assert isinstance(propose, Propose)
    grant = Grant(propose.term, propose.round, propose.config.version, at)
    return [effect for other in OTHERS for effect in lease.receive(other, grant, at)]


def renewed(lease: Lease, at: float, until: float) -> float:
    """Let the lease send rounds, granted by all, up to `until` [s]; return the time of the last one."""
    last = at
    while (at := max(at, lease.next_deadline())) < until:
        effects = lease.tick(at)
        if sent(effects, Propose):
            granted_by_all(lease, effects, at)
            last = at
    return last


def test_e10_whose_raised_term_was_given_up_raises_it_again_with_the_next_round() -> None:
    """The own voter has promised the raised term: it would refuse every further round of the old one."""
    lease, at = committed()
    raised = lease.gateway_term(replace(lease.term, n=lease.term.n + 5), at)
    [prepare] = sent(raised, Prepare)
    assert isinstance(prepare, Prepare)
    higher = replace(prepare.term, n=prepare.term.n + 3, issuer=OTHER.id)
    assert lease.receive(WITNESS, Nack(prepare.term, higher, None, 0.0, lease.config), at) == []
    [again] = sent(lease.tick(max(at, lease.next_deadline())), Prepare)
    assert isinstance(again, Prepare)
    assert again.term == Term(higher.n + 1, ME.id, ME.incarnation)


def test_e8_a_leader_looks_at_its_members_once_and_not_with_every_round(monkeypatch: pytest.MonkeyPatch) -> None:
    lease, at = committed()
    looked = list[float]()

    def counted(*given: object) -> Config:
        looked.append(at)
        return reshaped(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(leadership, "reshaped", counted)
    assert renewed(lease, at, at + 0.9 * STD.chain_silence_s) > at + 4.0 * STD.heartbeat_s
    assert len(looked) == 1, "all were heard within t_chain of it"


def test_e33_a_roster_that_changes_nothing_keeps_no_later_one_from_being_carried_out() -> None:
    lease, at = committed()
    same = [lease.request_roster(Roster(), at) for _ in range(2)]
    assert same == [[], []]
    [propose] = sent(lease.request_roster(Roster((Spare(7),)), at), Propose)
    assert isinstance(propose, Propose)
    assert propose.config.roster == Roster((Spare(7),))


def test_e16_grants_for_a_term_handed_to_a_leader_that_knows_nothing_of_it_yet_count_when_it_comes() -> None:
    """It leads under a lower term until the transfer proposal tells it that another has led since."""
    lease, at = committed()
    term = Term(lease.term.n + 5, OTHER.id, OTHER.incarnation)
    config = Config(Version(replace(term, n=term.n - 1)), TRIO, WITNESS, None, (OTHER, ME))
    for source in OTHERS:
        assert lease.receive(source, Grant(term, 1, config.version, at), at) == []
    effects = lease.receive(OTHER, Propose(term, config, 1, ME, (lease.term,), at, lease.agreed), at)
    assert [type(effect) for effect in effects if isinstance(effect, StepDown | BecomeLeader)] == [
        StepDown,
        BecomeLeader,
    ]
    assert lease.may_command(at)


def test_e21_a_leader_is_lonely_from_its_last_renewed_round_on() -> None:
    lonely_after_s, led_s = 2.0, 5.0
    lease, at = committed(replace(TWO, lonely="continue_after", continue_after_s=lonely_after_s))
    last = at = renewed(lease, at, at + led_s)
    effects = list[Effect]()
    while not any(isinstance(effect, Send) and effect.to == f"gateway{OTHER.id}" for effect in effects):
        at = max(at, lease.next_deadline())
        effects = lease.tick(at)
    assert lonely_after_s <= at - last < lonely_after_s + STD.grant_s


def test_e23_a_leader_tells_an_earlier_incarnation_that_a_later_one_is_known_and_notes_who_greets_it() -> None:
    lease, at = committed()
    earlier = replace(OTHER, incarnation=OTHER.incarnation - 1)
    [told] = sent(lease.receive(earlier, Hello(None, lease.agreed), at), Superseded)
    assert told == Superseded(OTHER.incarnation)
    assert lease.chain == (ME.id, OTHER.id)
    lease.receive(OTHER, Hello(lease.config.version, lease.agreed), at)
    assert lease.hello_of(OTHER.id) == (OTHER, at)


def test_e33_a_strangers_hello_changes_nothing_at_a_leader() -> None:
    """It is no occasion either to write what is due with the next round: anybody could set its pace."""
    lease, at = committed()
    lease.left_out = frozenset((OTHER.id,))
    assert lease.receive(Member(9, 1), Hello(None, lease.agreed), at) == []
    [propose] = sent(lease.receive(OTHER, Hello(None, lease.agreed), at), Propose)
    assert isinstance(propose, Propose)
    assert propose.config.chain == (ME,)
