"""The services that stop a fleet and let it go: each call is answered by what became of the word."""

from __future__ import annotations

from lfa.deploy.client.stop_call import ANSWER_S, KEPT_S, KNOWN_S, Said
from lfa.deploy.ros.bridge.stop_calls import StopCalls
from lfa.deploy.ros.cdr import CdrMessage
from lfa.deploy.ros.session import ServiceCall
from lfa.deploy.ros.types import from_cdr
from lfa.protocol.messages.stop import StopKnowledge, StopState, StopWord
from tests.deploy.ros.test_mapping import header

ROBOTS = (1, 2)
GO, STAND = StopWord(), StopWord(1, True)


class Service:
    """Calls with their answers, and the orders that they led to."""

    def __init__(self) -> None:
        self.said: list[Said] = []
        self.answers: list[tuple[bool, str]] = []
        self.calls = StopCalls(lambda said, _now: self.said.append(said))

    def ask(self, now: float, *, stand: bool) -> None:
        self.calls.ask(ServiceCall(None, self._answer), ROBOTS, now, stand=stand)

    def hear(self, robot: int, word: StopWord, now: float) -> None:
        self.calls.hear(robot, StopState(header(), StopKnowledge(word, True), at_rest=True, kept=True), now)

    def _answer(self, encoded: CdrMessage) -> None:
        response = from_cdr(encoded.payload, encoded.type)
        self.answers.append((response.success, response.message))


def test_a_stop_is_answered_when_every_gateway_stands() -> None:
    service = Service()
    service.ask(0.0, stand=True)
    service.calls.step(0.0)
    assert service.said[0].word == STAND
    for robot in ROBOTS:
        assert service.answers == []
        service.hear(robot, STAND, 0.01)
        service.calls.step(KEPT_S)
    assert service.answers == [(True, "stopped: robot1, robot2 (epoch 1)")]


def test_a_robot_that_does_not_answer_is_named() -> None:
    service = Service()
    service.ask(0.0, stand=True)
    service.hear(1, STAND, 0.01)
    service.calls.step(ANSWER_S + 0.01)
    ((success, message),) = service.answers
    assert not success
    assert "NOT STOPPED, no answer: robot2" in message


def test_a_resume_of_what_is_not_stopped_is_refused() -> None:
    service = Service()
    service.ask(0.0, stand=False)
    for robot in ROBOTS:
        service.hear(robot, GO, 0.01)
    service.calls.step(KNOWN_S)
    ((success, message),) = service.answers
    assert not success
    assert "none of the 2 robots that answer is stopped" in message


def test_a_stop_in_the_middle_of_a_resume_wins_and_says_so() -> None:
    service = Service()
    service.ask(0.0, stand=False)
    service.ask(0.1, stand=True)
    assert service.answers == [(False, "stop was called in the meantime")]
    service.calls.step(0.1)
    assert service.said[-1].word == STAND
