"""An operator's changes of a running team as a model, on the project's own `TeamOrders` (E32).

Two robots lead in turn under rising terms; operators propose two orders, the second after some leader carries the
first. What was proposed or carried can be heard at any later time, once, often or never. Checked at each step of a
robot: BACK: its order never returns to a lower version; OLD: no word of a lower term than the newest that it knows
changes it; ASKED: a new leader carries the newest order that it has heard.
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

ROBOTS, VERSIONS = (0, 1), (1, 2)
MISSION = Mission(robots=(1, 2), leading=Leading(route_m=((5.0, 0.0),)))
ORDERS = tuple(
    TeamOrder(structs.replace(MISSION.leading, route_m=((5.0 + n, 0.0),)), MISSION.formation, n, n) for n in (0, 1, 2)
)
#      robot r at 3 r: its order, the newest proposed one that it keeps, the newest term that it knows
HOLDS, KEEPS, KNOWS = range(3)
LEADER, TERM, SAID, CARRIED = range(6, 10)
"""Who leads, under which term, the proposed orders (mask); then, a byte for each term, the orders carried (mask)."""

MUTANTS: dict[str, tuple[str, Callable[[pytest.MonkeyPatch], None]]] = {
    "late_order": ("a late order is carried out", plants.late_orders_are_carried_out),
    "old_leader": ("the order of an old leader is obeyed", plants.orders_of_an_old_term_are_obeyed),
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
        carried = any(s[CARRIED:])
        due = [n for n in VERSIONS if not s[SAID] >> n & 1 and (n == 1 or carried)]
        return [((2, f"propose order {n}"), _with(s, SAID, s[SAID] | 1 << n), None) for n in due]

    def _leaders(self, s: State) -> list[Successor]:
        """Any robot leads next, under the next term."""
        out: list[Successor] = []
        for r in ROBOTS if s[TERM] < self.terms else ():
            orders, term = _orders(s, r), s[TERM] + 1
            orders.begin(Term(term, r + 1, 1), 0.0)
            b = bytearray(s)
            b[LEADER], b[TERM], b[3 * r + KNOWS] = r, term, term
            asked = None
            if orders.order.version < max(s[3 * r + HOLDS], s[3 * r + KEEPS]):
                asked = f"ASKED: robot {r + 1} leads with order {orders.order.version}, and has heard a newer one"
            out.append(self._after(s, b, r, orders, f"leads under term {term}", asked))
        return out

    def _robots(self, s: State) -> list[Successor]:
        """A robot hears what was proposed, or what the leader of some term carried."""
        out: list[Successor] = []
        for r in ROBOTS:
            leads, known = r == s[LEADER], s[3 * r + KNOWS]
            for n in VERSIONS:
                if s[SAID] >> n & 1:
                    orders = _orders(s, r)
                    orders.propose(ORDERS[n], leads, Term(known, r + 1, 1), 0.0)
                    out.append(self._after(s, bytearray(s), r, orders, f"hears the proposed order {n}"))
            for term in range(1, self.terms + 1):
                for n in VERSIONS:
                    if not leads and s[CARRIED + term - 1] >> n & 1:
                        orders, b = _orders(s, r), bytearray(s)
                        b[3 * r + KNOWS] = max(known, term)
                        note = OrderNote(Header("robot", 1, 1, 0.0), ORDERS[n], Term(term))
                        changed = orders.hear(note, Term(known), 0.0)
                        old = f"OLD: robot {r + 1} obeyed term {term}, and knew {known}" if term < known else None
                        out.append(
                            self._after(s, b, r, orders, f"hears order {n} of term {term}", old if changed else None)
                        )
        return out

    def _after(
        self, s: State, b: bytearray, r: int, orders: TeamOrders, text: str, wrong: str | None = None
    ) -> Successor:
        proposed, version = orders._proposed, orders.order.version
        b[3 * r + HOLDS], b[3 * r + KEEPS] = version, 0 if proposed is None else proposed.version
        if b[LEADER] == r and version:
            b[CARRIED + b[TERM] - 1] |= 1 << version
        if version < s[3 * r + HOLDS]:
            wrong = f"BACK: robot {r + 1} went back from order {s[3 * r + HOLDS]} to {version}"
        return (r, text), bytes(b), wrong


def _orders(s: State, r: int) -> TeamOrders:
    """The orders at robot r in this state."""
    orders = TeamOrders(Outbox("f", f"robot{r + 1}", 1), MISSION)
    orders.order = ORDERS[s[3 * r + HOLDS]]
    keeps = s[3 * r + KEEPS]
    orders._proposed = ORDERS[keeps] if keeps else None
    return orders


def _with(s: State, at: int, value: int) -> State:
    return s[:at] + bytes((value,)) + s[at + 1 :]
