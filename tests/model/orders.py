"""An operator's changes of a running team as a model, on the project's own `TeamOrders` (E32).

Two robots lead in turn under rising terms; operators propose orders: two that count on from the mission as it began,
and one that does from the first of them, once some leader carries that. What was proposed or carried can be heard
later at any time, once, often or never. Checked at each step of a robot: BACK: its order never returns to a lower
version; OLD: no word of a lower term than the newest that it knows changes it; ASKED: a new leader carries the newest
order that it has heard; SPLIT: who hears what the leader of the newest term carries holds no other one of its version.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest
from msgspec import structs

from lfa.agents.orders.team_orders import TeamOrders
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.orders import OrderNote, TeamOrder
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.outbox import Outbox
from tests.model.checker import State, Step, Successor
from tests.protocol.lease import plants_of_orders as plants

ROBOTS, OFFERED = (0, 1), (1, 2, 3)
MISSION = Mission(robots=(1, 2), leading=Leading(route_m=((5.0, 0.0),)))
ORDERS = tuple(
    TeamOrder(structs.replace(MISSION.leading, route_m=((5.0 + n, 0.0),)), MISSION.formation, version, version)
    for n, version in enumerate((0, 1, 2, 1))
)
"""The mission as it began; the first order, and the one after it; another first one."""
#      robot r at 4 r: its order, the newest proposed one that it keeps, the newest term that it knows, its order's term
HOLDS, KEEPS, KNOWS, UNDER = range(4)
LEADER, TERM, SAID, CARRIED = range(8, 12)
"""Who leads, under which term, the proposed orders (mask); then, a byte for each term, the orders carried (mask)."""

MUTANTS: dict[str, tuple[str, Callable[[pytest.MonkeyPatch], None]]] = {
    "late_order": ("a late order is carried out", plants.late_orders_are_carried_out),
    "old_leader": ("the order of an old leader is obeyed", plants.orders_of_an_old_term_are_obeyed),
    "equal_versions": ("two orders of one version count as one", plants.orders_of_one_version_are_one),
    "forgets": ("a new leader forgets what an operator has asked for", plants.new_leader_forgets_proposals),
}


class OrderModel:
    columns = ("robot 1", "robot 2", "operators")

    def __init__(self, terms: int, mutant: str = "") -> None:
        """`terms` in which the robots lead in any turn."""
        self.terms, self.mutant = terms, mutant

    def initial(self) -> State:
        s = bytearray(CARRIED + self.terms)
        s[TERM] = s[KNOWS] = 1
        return bytes(s)

    def step(self, event: tuple[object, ...]) -> Step:
        column, text = event
        assert isinstance(column, int)
        return Step(column, str(text))

    def successors(self, s: State) -> list[Successor]:
        with pytest.MonkeyPatch.context() as patch:
            if self.mutant:
                MUTANTS[self.mutant][1](patch)
            return [*self._operators(s), *self._robots(s), *self._leaders(s)]

    def _operators(self, s: State) -> list[Successor]:
        carried = any(known >> 1 & 1 for known in s[CARRIED:])
        due = [n for n in OFFERED if not s[SAID] >> n & 1 and (n != 2 or carried)]
        return [((2, f"propose order {n}"), _with(s, SAID, s[SAID] | 1 << n), None) for n in due]

    def _leaders(self, s: State) -> list[Successor]:
        """Any robot leads next, under the next term."""
        out: list[Successor] = []
        for r in ROBOTS if s[TERM] < self.terms else ():
            orders, term = _orders(s, r), s[TERM] + 1
            orders.begin(Term(term, r + 1, 1), 0.0)
            b = bytearray(s)
            b[LEADER], b[TERM], b[4 * r + KNOWS] = r, term, term
            asked = None
            if orders.order.version < max(ORDERS[s[4 * r + at]].version for at in (HOLDS, KEEPS)):
                asked = f"ASKED: robot {r + 1} leads with order {orders.order.version}, and has heard a newer one"
            out.append(self._after(s, b, r, orders, f"leads under term {term}", asked))
        return out

    def _robots(self, s: State) -> list[Successor]:
        """A robot hears what was proposed, or what the leader of some term carried."""
        out: list[Successor] = []
        for r in ROBOTS:
            leads, known = r == s[LEADER], s[4 * r + KNOWS]
            for n in OFFERED:
                if s[SAID] >> n & 1:
                    orders = _orders(s, r)
                    orders.propose(ORDERS[n], leads, Term(known, r + 1, 1), 0.0)
                    out.append(self._after(s, bytearray(s), r, orders, f"hears the proposed order {n}"))
            for term in range(1, self.terms + 1):
                for n in OFFERED:
                    if not leads and s[CARRIED + term - 1] >> n & 1:
                        out.append(self._hears(s, r, n, term))
        return out

    def _hears(self, s: State, r: int, n: int, term: int) -> Successor:
        """Robot r, which does not lead, hears order n as the leader of `term` carried it."""
        orders, b, known, wrong = _orders(s, r), bytearray(s), s[4 * r + KNOWS], None
        b[4 * r + KNOWS] = max(known, term)
        changed = orders.hear(OrderNote(Header("robot", 1, 1, 0.0), ORDERS[n], Term(term)), Term(known), 0.0)
        if changed and term < known:
            wrong = f"OLD: robot {r + 1} obeyed term {term}, and knew {known}"
        latest = term == s[TERM] and n == s[4 * s[LEADER] + HOLDS]
        if latest and orders.order.version == ORDERS[n].version and orders.order != ORDERS[n]:
            wrong = f"SPLIT: robot {r + 1} hears order {n} of its leader, and holds another of this version"
        return self._after(s, b, r, orders, f"hears order {n} of term {term}", wrong)

    def _after(
        self, s: State, b: bytearray, r: int, orders: TeamOrders, text: str, wrong: str | None = None
    ) -> Successor:
        holds, keeps = ORDERS.index(orders.order), orders._proposed
        b[4 * r + HOLDS], b[4 * r + KEEPS] = holds, 0 if keeps is None else ORDERS.index(keeps)
        b[4 * r + UNDER] = orders._carried.n
        if b[LEADER] == r and holds:
            b[CARRIED + b[TERM] - 1] |= 1 << holds
        before = s[4 * r + HOLDS]
        if ORDERS[holds].version < ORDERS[before].version:
            wrong = f"BACK: robot {r + 1} went back from order {before} to {holds}"
        return (r, text), bytes(b), wrong


def _orders(s: State, r: int) -> TeamOrders:
    """The orders at robot r in this state."""
    orders = TeamOrders(Outbox("f", f"robot{r + 1}", 1), MISSION)
    orders.order, orders._carried = ORDERS[s[4 * r + HOLDS]], Term(s[4 * r + UNDER])
    keeps = s[4 * r + KEEPS]
    orders._proposed = ORDERS[keeps] if keeps else None
    return orders


def _with(s: State, at: int, value: int) -> State:
    return s[:at] + bytes((value,)) + s[at + 1 :]
