"""`StopLatch` and `StopMemory` against the model's rules, in every state that they can reach with two epochs.

Each function answers how many comparisons it made, and raises AssertionError where the classes decide otherwise.
"""

from __future__ import annotations

from itertools import product

from lfa.protocol.fleet_stop.latch import StopLatch
from lfa.protocol.fleet_stop.memory import StopMemory
from lfa.protocol.messages.consensus import Member
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.stop import StopKnowledge, StopOrder, StopWord
from tests.model.fleet_stop import stop_rules as rules

WORDS = (StopWord(), StopWord(1), StopWord(1, True), StopWord(2), StopWord(2, True))
"""By the model's numbers."""
ROBOT, INCARNATION, DEPTH = 1, 7, 3
OTHERS = ((), (Member(ROBOT, INCARNATION - 1), Member(2, INCARNATION)))
NAMED = (Member(ROBOT, INCARNATION),)
Input = tuple[str, int, bool]
"""An order of a word, named or not, or an agent's word, certain or not."""
INPUTS: tuple[Input, ...] = tuple(product(("order", "agent"), range(len(WORDS)), (False, True)))


def latch() -> int:
    """Orders and commands in every order: word, certainty and wheels of a `StopLatch` are the rules'."""
    compared = 0
    for inputs in product(INPUTS, repeat=DEPTH):
        real, word, certain, agent = StopLatch(ROBOT, INCARNATION), 0, False, -1
        for number, (kind, given, flag) in enumerate(inputs):
            if kind == "order":
                real.order(_order(number, given, flag), 0.0)
                word, certain = rules.ordered(word, certain, given, flag)
            else:
                real.hear_agent(StopKnowledge(WORDS[given], flag))
                (word, certain), agent = rules.told(word, certain, given, flag), given
        assert real.known == StopKnowledge(WORDS[word], certain), inputs
        assert real.holds(0.0) == (rules.stands(word) or not certain), inputs
        assert real.kept == (agent >= word), inputs
        compared += 1
    return compared


def _order(number: int, word: int, named: bool) -> StopOrder:
    gateways = NAMED if named else OTHERS[number % len(OTHERS)]
    return StopOrder(Header("operator", 1, number, 0.0), WORDS[word], gateways)


def memory() -> int:
    """Orders, the own gateway and other agents in every order: what a `StopMemory` of three robots knows."""
    compared = 0
    heard_from = tuple(("agent", word, robot) for word, robot in product(range(len(WORDS)), (2, 3)))
    gateway = tuple(("gateway", word, sure) for word, sure in product(range(len(WORDS)), (0, 1)))
    orders = tuple(("order", word, 0) for word in range(len(WORDS)))
    for inputs in product((*heard_from, *gateway, *orders), repeat=DEPTH):
        real, word, sure, heard = StopMemory(ROBOT, (1, 2, 3)), 0, False, 1
        for kind, given, who in inputs:
            known = StopKnowledge(WORDS[given], bool(who))
            if kind == "order":
                real.order(_order(0, given, named=False))
                word = max(word, given)
            elif kind == "gateway":
                real.hear_gateway(known)
                word, sure = max(word, given), sure or bool(who)
            else:
                real.hear_agent(who, known)
                if not sure:
                    word, heard = max(word, given), heard | 1 << who - 1
                    sure = rules.enough(heard, 3)
        assert real.known == StopKnowledge(WORDS[word], sure), inputs
        compared += 1
    return compared


ALL = (latch, memory)
