"""E30 at one agent: from whom it learns after its start what holds."""

from __future__ import annotations

from lfa.protocol.fleet_stop.memory import ASK_S, StopMemory
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.stop import NEVER_STOPPED, UNCERTAIN, StopKnowledge, StopOrder, StopWord

STOPPED = StopKnowledge(StopWord(3, True), True)


def test_e30_its_own_gateway_makes_it_certain() -> None:
    memory = StopMemory(1, (1, 2, 3, 4))
    memory.hear_gateway(UNCERTAIN)
    assert not memory.certain
    memory.hear_gateway(STOPPED)
    assert memory.known == STOPPED


def test_e30_more_than_half_of_a_team_that_has_started_lets_it_go() -> None:
    memory = StopMemory(1, (1, 2, 3, 4))
    memory.hear_agent(2, UNCERTAIN)
    assert not memory.certain, "2 of 4"
    memory.hear_agent(2, UNCERTAIN)
    assert not memory.certain, "the same one again"
    memory.hear_agent(9, UNCERTAIN)
    assert not memory.certain, "a stranger"
    memory.hear_agent(3, UNCERTAIN)
    assert memory.known == NEVER_STOPPED


def test_e30_one_of_them_that_knows_of_a_stop_is_enough_to_stand() -> None:
    memory = StopMemory(1, (1, 2, 3, 4))
    memory.hear_agent(2, STOPPED)
    memory.hear_agent(3, UNCERTAIN)
    assert memory.stands and memory.certain


def test_e30_a_team_that_begins_without_some_of_its_robots_needs_the_answers_of_its_chain_only() -> None:
    memory = StopMemory(1, (1, 2, 3, 4))
    memory.hear_chain((1, 2))
    assert not memory.certain
    memory.hear_agent(2, UNCERTAIN)
    assert memory.known == NEVER_STOPPED


def test_e30_who_joins_a_chain_that_was_stopped_stands_with_it() -> None:
    memory = StopMemory(3, (1, 2, 3, 4))
    memory.hear_chain((1, 3))
    memory.hear_agent(1, STOPPED)
    assert memory.stands and memory.certain


def test_it_knows_the_robots_of_its_mission_and_of_its_chain_less_those_lost_for_good() -> None:
    memory = StopMemory(1, (1, 2, 3))
    memory.hear_chain((1, 2, 7))
    memory.forget((3,))
    assert memory.robots == (1, 2, 7)


def test_a_certain_agent_takes_no_word_from_another() -> None:
    memory = StopMemory(1, (1,))
    memory.hear_agent(2, STOPPED)
    assert memory.known == NEVER_STOPPED


def test_it_hears_the_orders_itself_and_asks_until_it_is_certain() -> None:
    memory = StopMemory(1, (1, 2, 3))
    memory.order(StopOrder(Header("operator", 1, 1, 0.0), StopWord(1, True)))
    assert memory.stands and not memory.certain
    assert memory.ask_due(0.0) and not memory.ask_due(0.5 * ASK_S) and memory.ask_due(ASK_S)
    memory.hear_agent(2, UNCERTAIN)
    assert not memory.ask_due(10.0)


def test_the_answer_of_a_forgotten_robot_is_not_waited_for() -> None:
    memory = StopMemory(1, (1, 2, 3, 4))
    memory.hear_agent(2, UNCERTAIN)
    memory.forget((4,))
    assert memory.certain
