"""The fleet stop at the gateways of the simulated world: answers, rest, and the operator's absence (E28, E31)."""

from __future__ import annotations

from lfa.protocol.geometry import Twist
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import Sensors
from lfa.protocol.messages.stop import StopOrder, StopState, StopWord
from tests.rigs.world_rig import Rig, last, of

GO = Twist(0.5, 0.0)


def order(rig: Rig, word: StopWord | None, seq: int) -> None:
    rig.hear("operator/stop", StopOrder(Header("operator", 7, seq, rig.now), word))


def speeds(rig: Rig) -> list[float]:
    return [robot.linear_x for robot in rig.truth().robots]


def test_e28_every_gateway_answers_an_order_and_says_once_that_its_wheels_rest() -> None:
    rig = Rig().opened()
    rig.run(2.0, GO)
    order(rig, StopWord(1, True), 1)
    answers = of(rig.said, StopState)
    assert [answer.at_rest for answer in answers] == [False] * 4
    said = rig.run(2.0, GO)
    assert [answer.at_rest for answer in of(said, StopState)] == [True] * 4
    assert speeds(rig) == [0.0] * 4
    assert last(rig.said, Sensors).stands


def test_e28_a_robot_whose_driver_hangs_does_not_answer() -> None:
    rig = Rig().opened()
    rig.run(1.0, GO)
    rig.world._robots[2].hang("driver", rig.now)
    order(rig, StopWord(1, True), 1)
    assert len(of(rig.said, StopState)) == 3
    assert of(rig.said, StopState, "robot3") == []


def test_e31_without_an_operator_the_team_stands_and_goes_when_one_is_there() -> None:
    rig = Rig("mission.operator_timeout_s=1.0").opened()
    rig.run(1.0, GO)
    assert speeds(rig) == [0.0] * 4, "nobody has been heard yet"
    order(rig, None, 1)
    rig.run(0.9, GO)
    assert min(speeds(rig)) > 0.3
    rig.run(1.5, GO)
    assert speeds(rig) == [0.0] * 4, "silent for longer than a second"
    order(rig, None, 2)
    rig.run(0.9, GO)
    assert min(speeds(rig)) > 0.3
