"""A candidate's term is above every term that its process has heard of, from whomever (E6, E10)."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.messages.consensus import Config, Nack, Prepare, Propose, Term, Version
from tests.rigs.lease_scenes import OTHERS, STD, alone, elected, sent

HEARD, LOWER = Term(40, 2, 4), Term(30, 2, 4)
PEER = OTHERS[1]


def prepare(lease: Lease, term: Term) -> None:
    lease.receive(PEER, Prepare(term, lease.config.version, agreed=lease.agreed), 0.1)


def propose(lease: Lease, term: Term) -> None:
    """Propose without a vote of this process: it learns the term all the same."""
    config = Config(Version(), (PEER,), None, None, ())
    lease.receive(PEER, Propose(term, config, 0, PEER, agreed=lease.agreed), 0.1)


def nack(lease: Lease, term: Term) -> None:
    lease.receive(PEER, Nack(Term(1, 1, 7), term, None, 0.0, lease.config), 0.1)


def gateway(lease: Lease, term: Term) -> None:
    lease.gateway_term(term, 0.1)


@pytest.mark.parametrize("hear", [prepare, propose, nack, gateway])
def test_a_candidate_outbids_the_highest_term_heard_however_low_the_last_one(
    hear: Callable[[Lease, Term], None],
) -> None:
    lease = alone()
    for term in (HEARD, LOWER):
        hear(lease, term)
    asked: list[object] = []
    for n in range(1000):
        asked = sent(lease.tick(STD.grant_s + 0.01 * n), Prepare)
        if asked:
            break
    [request] = asked
    assert isinstance(request, Prepare)
    assert request.term.n == HEARD.n + 1


def test_e10_a_leader_raises_its_term_above_the_one_that_its_gateway_has_seen() -> None:
    lease, _, at, _ = elected(0.001)
    [request] = sent(lease.gateway_term(HEARD, at), Prepare)
    assert isinstance(request, Prepare)
    assert request.term == Term(HEARD.n + 1, 1, 7)
    assert not lease.is_settled(at), "answers wake it until its quorum has promised"
