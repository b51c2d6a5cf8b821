"""The operator's side of a stop and a resume (E29): epochs are counted up without a clock, and nobody is left out."""

from __future__ import annotations

import pytest

from lfa.deploy.client.stop_call import ANSWER_S, ASK_S, BRAKED_S, KNOWN_S, NEWS_S, REPEAT_S, REST_S, Said, StopCall
from lfa.protocol.errors import Refused
from lfa.protocol.messages.consensus import Member
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.stop import StopKnowledge, StopState, StopWord


class Gateway:
    """The answers of one gateway."""

    def __init__(self, incarnation: int = 9) -> None:
        self._incarnation = incarnation
        self._seq = 0

    def state(
        self, epoch: int, stand: bool, *, at_rest: bool = True, certain: bool = True, kept: bool = True
    ) -> StopState:
        self._seq += 1
        header = Header("world", self._incarnation, self._seq, 0.0)
        return StopState(header, StopKnowledge(StopWord(epoch, stand), certain), at_rest, kept)


def called(stand: bool, robots: int = 2) -> tuple[StopCall, list[Gateway]]:
    call = StopCall(stand, 0.0)
    call.name(tuple(range(1, robots + 1)))
    return call, [Gateway() for _ in range(robots)]


def test_a_stop_is_said_at_once_and_repeated() -> None:
    call, _ = called(True)
    assert call.said(0.0) == Said(StopWord(1, True), ())
    assert call.said(0.5 * REPEAT_S) is None
    assert call.said(REPEAT_S) == Said(StopWord(1, True), ())


def test_a_stop_counts_up_from_the_resume_that_an_answer_tells_of() -> None:
    call, (one, _) = called(True)
    call.said(0.0)
    call.hear(1, one.state(6, False), 0.001)
    assert call.said(0.001) == Said(StopWord(7, True), (Member(1, 9),))


@pytest.mark.parametrize("stand", [True, False])
def test_e29_the_last_epoch_in_one_gateways_answer_keeps_no_operator_from_stopping_and_resuming(stand: bool) -> None:
    call, gateways = called(True, 3)
    call.hear(3, gateways[2].state(2**53, stand), 0.001)
    for robot in (1, 2):
        call.hear(robot, gateways[robot - 1].state(6, False), 0.002)
    said = call.said(0.002)
    assert said is not None and said.word == StopWord(7, True)
    call, _ = called(False, 3)
    call.hear(3, gateways[2].state(2**53, stand), 0.001)
    for robot in (1, 2):
        call.hear(robot, gateways[robot - 1].state(7, True), 0.002)
    said = call.said(0.002)
    assert said is not None and said.word == StopWord(8, False)
    for robot in (1, 2):
        call.hear(robot, gateways[robot - 1].state(8, False), 0.003)
    outcome = call.outcome(ANSWER_S + 0.1)
    assert outcome is not None and not outcome.overruled and {1, 2} <= set(outcome.done)


def test_e29_a_great_epoch_that_most_gateways_tell_is_counted_up() -> None:
    call, gateways = called(True, 3)
    for robot in (1, 2):
        call.hear(robot, gateways[robot - 1].state(2**43 + robot, False), 0.001)
    said = call.said(0.001)
    assert said is not None and said.word == StopWord(2**43 + 3, True)


def test_a_stop_that_holds_already_is_the_same_stop() -> None:
    call, gateways = called(True)
    for robot, gateway in enumerate(gateways, start=1):
        call.hear(robot, gateway.state(5, True), 0.001)
    outcome = call.outcome(0.001)
    assert outcome is not None and outcome.complete and outcome.epoch == 5


def test_who_has_not_answered_within_a_second_is_named() -> None:
    call, (one, _) = called(True)
    call.hear(1, one.state(1, True), 0.1)
    assert call.outcome(ANSWER_S - 0.01) is None
    outcome = call.outcome(ANSWER_S)
    assert outcome is not None and not outcome.complete
    assert (outcome.done, outcome.silent) == ((1,), (2,))


def test_a_robot_that_goes_on_saying_that_its_wheels_turn_is_waited_for_and_then_named() -> None:
    call, (gateway,) = called(True, robots=1)
    now = 0.0
    while now < REST_S:
        call.hear(1, gateway.state(1, True, at_rest=False), now)
        assert call.outcome(now) is None
        now += 0.5 * NEWS_S
    outcome = call.outcome(REST_S)
    assert outcome is not None and outcome.moving == (1,) and not outcome.complete


def test_a_robot_is_named_that_said_that_its_wheels_turn_and_is_not_heard_any_more() -> None:
    call, (one, two) = called(True)
    call.hear(1, one.state(1, True), 0.1)
    call.hear(2, two.state(1, True, at_rest=False), 0.1)
    assert call.outcome(BRAKED_S - 0.01) is None
    outcome = call.outcome(BRAKED_S)
    assert outcome is not None and (outcome.done, outcome.moving) == ((1,), (2,)) and not outcome.complete


def test_the_fleet_is_asked_for_its_robots_until_somebody_has_told_all() -> None:
    call = StopCall(True, 0.0)
    assert call.asks(0.0) and not call.asks(0.5 * ASK_S) and call.asks(ASK_S)
    call.name((1,), all_known=False)
    assert call.asks(2 * ASK_S)
    call.name((1, 2))
    assert not call.asks(9.0)


def test_a_restarted_gateway_that_forgot_its_stop_counts_no_more() -> None:
    call, (one, two) = called(True)
    call.hear(1, one.state(1, True), 0.1)
    call.hear(2, two.state(1, True, at_rest=False), 0.1)
    call.hear(1, Gateway(10).state(0, False, certain=False), 0.2)
    outcome = call.outcome(ANSWER_S)
    assert outcome is not None and outcome.silent == (1,)


def test_a_resume_asks_first_and_is_one_more_than_the_newest_stop() -> None:
    call, (one, two) = called(False)
    assert call.said(0.0) == Said(None, ())
    call.hear(1, one.state(3, True), 0.01)
    assert call.said(REPEAT_S) == Said(None, (Member(1, 9),))
    call.hear(2, two.state(5, True), 0.04)
    assert call.said(2 * REPEAT_S) == Said(StopWord(6, False), (Member(1, 9), Member(2, 9)))
    call.hear(1, one.state(6, False), 0.07)
    call.hear(2, two.state(6, False), 0.07)
    outcome = call.outcome(0.07)
    assert outcome is not None and outcome.complete and outcome.done == (1, 2)


def test_a_resume_goes_without_those_that_do_not_answer_and_names_them() -> None:
    call, (one, _) = called(False)
    call.hear(1, one.state(3, True), 0.01)
    call.said(0.02)
    assert call.said(KNOWN_S) == Said(StopWord(4, False), (Member(1, 9),))
    call.hear(1, one.state(4, False), KNOWN_S)
    outcome = call.outcome(ANSWER_S)
    assert outcome is not None and (outcome.done, outcome.silent) == ((1,), (2,))


def test_a_resume_without_a_stop_is_refused() -> None:
    call, gateways = called(False)
    for robot, gateway in enumerate(gateways, start=1):
        call.hear(robot, gateway.state(2, False), 0.01)
    with pytest.raises(Refused, match="none of the 2 robots that answer is stopped"):
        call.said(0.02)


def test_a_resume_that_nobody_answers_is_refused() -> None:
    call, _ = called(False)
    call.said(0.0)
    with pytest.raises(Refused, match="no gateway answers"):
        call.said(KNOWN_S)


def test_a_resume_lets_a_restarted_gateway_go_that_nobody_could_tell() -> None:
    call, gateways = called(False, robots=1)
    call.hear(1, gateways[0].state(0, False, certain=False), 0.01)
    assert call.said(0.02) == Said(StopWord(1, False), (Member(1, 9),))


def test_a_stop_said_after_a_resume_wins_over_it() -> None:
    call, gateways = called(False, robots=1)
    call.hear(1, gateways[0].state(3, True), 0.01)
    call.said(0.02)
    call.hear(1, gateways[0].state(5, True), 0.03)
    outcome = call.outcome(0.03)
    assert outcome is not None and outcome.overruled and not outcome.complete


def test_an_overtaken_answer_changes_nothing() -> None:
    call, gateways = called(True, robots=1)
    old, new = gateways[0].state(0, False), gateways[0].state(1, True)
    call.hear(1, new, 0.01)
    call.hear(1, old, 0.02)
    outcome = call.outcome(0.02)
    assert outcome is not None and outcome.complete
