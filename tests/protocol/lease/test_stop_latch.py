"""E28, E29, E31 at one gateway, and its half of E30."""

from __future__ import annotations

from lfa.protocol.fleet_stop.latch import OPERATORS_MAX, StopLatch
from lfa.protocol.messages.consensus import Member
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.stop import NEVER_STOPPED, StopKnowledge, StopOrder, StopWord

ME = Member(3, 9)


def order(word: StopWord | None, seq: int = 1, *gateways: Member, operator: int = 7) -> StopOrder:
    return StopOrder(Header("operator", operator, seq, 0.0), word, gateways)


def started(operator_timeout_s: float | None = None) -> StopLatch:
    return StopLatch(ME.id, ME.incarnation, operator_timeout_s)


def going(operator_timeout_s: float | None = None) -> StopLatch:
    latch = started(operator_timeout_s)
    latch.hear_agent(NEVER_STOPPED)
    return latch


def test_e28_a_stop_holds_until_a_later_resume() -> None:
    latch = going()
    assert not latch.holds(0.0)
    latch.order(order(StopWord(1, True)), 0.0)
    assert latch.holds(0.0) and latch.holds(1e6)
    latch.order(order(StopWord(2, False), 2), 1.0)
    assert not latch.holds(1.0)


def test_e29_late_and_replayed_words_are_void() -> None:
    latch = going()
    latch.order(order(StopWord(3, True)), 0.0)
    latch.order(order(StopWord(2, False), 2), 0.0)
    assert latch.holds(0.0), "a late resume"
    latch.order(order(StopWord(4, False), 3), 0.0)
    latch.order(order(StopWord(3, True), 1), 0.0)
    assert not latch.holds(0.0), "a replayed stop"


def test_e29_of_a_stop_and_a_resume_of_one_epoch_the_stop_holds_in_any_order() -> None:
    for words in ((True, False), (False, True)):
        latch = going()
        for seq, stand in enumerate(words):
            latch.order(order(StopWord(5, stand), seq), 0.0)
        assert latch.holds(0.0)


def test_e30_a_gateway_that_starts_stands_until_its_agent_tells_it_what_holds() -> None:
    for known, stands in ((NEVER_STOPPED, False), (StopKnowledge(StopWord(4, True), True), True)):
        latch = started()
        assert latch.holds(0.0)
        latch.hear_agent(known)
        assert latch.holds(0.0) is stands


def test_e30_an_agent_that_is_not_certain_lets_nothing_go() -> None:
    latch = started()
    latch.hear_agent(StopKnowledge(StopWord(4, False), False))
    assert latch.holds(0.0)


def test_e30_a_replayed_resume_lets_no_gateway_go_that_has_just_started() -> None:
    latch = started()
    latch.order(order(StopWord(4, False), 1, Member(3, 8), Member(2, 9)), 0.0)
    assert latch.holds(0.0), "it names another incarnation, and another robot"
    latch.order(order(StopWord(4, False), 2, ME), 0.0)
    assert not latch.holds(0.0)


def test_e30_an_agent_may_stop_its_gateway_and_lifts_no_stop() -> None:
    latch = going()
    latch.hear_agent(StopKnowledge(StopWord(1, True), True))
    assert latch.holds(0.0), "the gateway has missed the order"
    latch.hear_agent(StopKnowledge(StopWord(2, False), True))
    assert latch.holds(0.0), "only an operator lifts it"


def test_a_word_is_kept_once_the_agent_says_it_too() -> None:
    latch = going()
    latch.order(order(StopWord(1, True)), 0.0)
    assert not latch.kept
    latch.hear_agent(StopKnowledge(StopWord(1, True), True))
    assert latch.kept


def test_e31_without_an_operator_it_stands_and_goes_on_when_one_is_there_again() -> None:
    latch = going(operator_timeout_s=1.0)
    assert latch.holds(0.0), "none has been heard yet"
    latch.order(order(None, 1), 10.0)
    assert not latch.holds(11.0) and latch.holds(11.1)
    latch.order(order(None, 2), 12.0)
    assert not latch.holds(12.5)


def test_e31_a_replayed_order_is_no_sign_of_an_operator() -> None:
    latch = going(operator_timeout_s=1.0)
    latch.order(order(None, 5), 10.0)
    latch.order(order(None, 5), 12.0)
    latch.order(order(None, 4), 12.0)
    assert latch.holds(12.0)


def test_the_operators_that_a_gateway_remembers_are_bounded() -> None:
    latch = going()
    for operator in range(3 * OPERATORS_MAX):
        latch.order(order(None, 1, operator=operator), 0.0)
    assert len(latch._heard) == OPERATORS_MAX
