"""How the rule of an operator's changes of a running team (E32) is broken on purpose, each by a patch."""

from __future__ import annotations

import pytest
from msgspec import structs

from lfa.agents.orders.team_orders import TeamOrders
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.orders import OrderNote, TeamOrder


def late_orders_are_carried_out(patch: pytest.MonkeyPatch) -> None:
    honest = TeamOrders.propose

    def propose(self: TeamOrders, order: TeamOrder, leads: bool, term: Term, now: float) -> bool:
        if leads and 0 < order.version < self.order.version:
            self.order = structs.replace(self.order, version=order.version - 1)
        return honest(self, order, leads, term, now)

    patch.setattr(TeamOrders, "propose", propose)


def orders_of_an_old_term_are_obeyed(patch: pytest.MonkeyPatch) -> None:
    honest = TeamOrders.hear

    def hear(self: TeamOrders, note: OrderNote, newest: Term, now: float) -> bool:
        return honest(self, note, Term() if note.term is not None else newest, now)

    patch.setattr(TeamOrders, "hear", hear)


def orders_of_one_version_are_one(patch: pytest.MonkeyPatch) -> None:
    honest = TeamOrders.hear

    def hear(self: TeamOrders, note: OrderNote, newest: Term, now: float) -> bool:
        return note.order.version > self.order.version and honest(self, note, newest, now)

    patch.setattr(TeamOrders, "hear", hear)


def nobody_tells_a_new_leader(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(TeamOrders, "follow", lambda self, newest, now: None)


def new_leader_forgets_proposals(patch: pytest.MonkeyPatch) -> None:
    honest = TeamOrders.begin

    def begin(self: TeamOrders, term: Term, now: float) -> bool:
        self._proposed = None
        return honest(self, term, now)

    patch.setattr(TeamOrders, "begin", begin)
