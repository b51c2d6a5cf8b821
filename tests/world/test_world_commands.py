"""The world as a Node: commands come through gateways only."""

from __future__ import annotations

import pytest

from lfa.protocol.geometry import Twist
from lfa.protocol.messages.consensus import Fence, Fenced, GatewayStamp, LeaseNote, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel, Sensors
from lfa.protocol.messages.team import Ask, MissionNote
from lfa.protocol.node import PeerDown, PeerUp, RouterLost, Stop
from lfa.world.description.load import load
from tests.rigs.world_rig import FLEET, STD, T0, TERM, Rig, events, last, of


def test_robots_go_where_they_are_commanded() -> None:
    rig = Rig().opened()
    rig.run(4.0, Twist(0.5, 0.0))
    assert [robot.linear_x for robot in rig.truth().robots] == [0.5] * 4
    assert rig.truth().robots[0].x == pytest.approx(1.875, abs=0.02)


def test_a_new_gateway_obeys_nobody_for_T_grant() -> None:
    rig = Rig()
    rig.run(STD.grant_s - 0.02, Twist(0.5, 0.0))
    assert rig.truth().robots[0].x == 0.0
    assert [event.data["reason"] for event in events(rig.said, "refused")] == ["shut"] * 4


def test_the_deadman_brakes_a_robot_whose_agent_falls_silent() -> None:
    rig = Rig().opened()
    rig.run(2.0, Twist(0.5, 0.0))
    rig.run(STD.deadman_s + 0.5 / 1.0 + 0.03)  # the deadman, then 0.5 m/s at 1 m/s2
    assert [robot.linear_x for robot in rig.truth().robots] == [0.0] * 4


def test_a_command_with_an_old_stamp_moves_nobody() -> None:
    rig = Rig().opened()
    for _ in range(50):
        rig.run(0.02)
        rig.command(1, Twist(0.5, 0.0), as_leader=True, gateway=GatewayStamp(9, rig.now - STD.deadman_s - 0.01))
    assert rig.truth().robots[0].x == 0.0
    assert rig.world._robots[0].gateway.refused == {"old_stamp": 50}


def test_a_command_of_an_older_term_moves_nobody() -> None:
    """Planted bug of the foundation: `cmd_vel` without the term check."""
    rig = Rig().opened()
    rig.run(0.1, Twist(0.0, 0.0))
    for _ in range(50):
        rig.run(0.02)
        rig.command(1, Twist(0.5, 0.0), term=Term(4, 1, 1))
    assert rig.truth().robots[0].x == 0.0
    assert last(rig.said, Sensors, "robot1").term_max == TERM


def test_a_leader_command_is_told_once_a_term_and_robot() -> None:
    rig = Rig().opened()
    rig.run(1.0, Twist(0.1, 0.0))
    rig.command(2, Twist(0.1, 0.0), as_leader=True, term=Term(6, 2, 1), holder=2)
    rig.command(2, Twist(0.1, 0.0), as_leader=True, term=Term(6, 2, 1), holder=2)
    told = events(rig.said, "leader_command")
    assert [(event.term, event.data["robot"]) for event in told] == [(TERM, 1), (Term(6, 2, 1), 2)]
    assert told[1].data["t"] == pytest.approx(rig.now - T0)
    assert told[0].header.sender == "world"


def test_a_change_back_to_an_older_leader_is_told() -> None:
    """What a violation of I2 looks like from outside: the old leader's own gateway still obeys it."""
    rig = Rig().opened()
    rig.run(0.1, Twist(0.1, 0.0))
    rig.command(1, Twist(0.1, 0.0), as_leader=True)
    rig.command(2, Twist(0.1, 0.0), as_leader=True, term=Term(6, 2, 1), holder=2)
    rig.command(1, Twist(0.1, 0.0), as_leader=True)
    told = events(rig.said, "leader_command")
    assert [event.data["robot"] for event in told] == [1, 2, 1]


def test_refusals_are_told_once_a_reason_and_term() -> None:
    rig = Rig().opened()
    rig.run(0.02, Twist(0.0, 0.0))
    for _ in range(100):
        rig.command(1, Twist(0.5, 0.0), term=Term(4, 1, 1))
        rig.command(1, Twist(0.5, 0.0), gateway=GatewayStamp(8, rig.now))
    refused = [(event.data["robot"], event.data["reason"]) for event in events(rig.said, "refused")]
    assert refused == [(1, "old_term"), (1, "foreign_stamp")]


def test_a_flood_of_terms_makes_no_flood_of_events() -> None:
    rig = Rig()
    rig.run(0.02)
    for n in range(1000):
        rig.command(1, Twist(0.5, 0.0), term=Term(n, 1, 1))
    assert len(events(rig.said, "refused")) == 1


def test_FENCE_is_answered_by_the_gateway_it_names_to_all() -> None:
    rig = Rig().opened()
    rig.run(1.0, Twist(0.5, 0.0))
    note = LeaseNote(Header("robot2", 1, 1, rig.now), Fence(TERM, Term(6, 2, 1)))
    (fenced,) = rig.hear("robot2/lease/gateway1", note)
    assert fenced.key == f"lfa/{FLEET}/robot1/lease/all"
    assert isinstance(fenced.message, LeaseNote)
    assert fenced.message.header.sender == "robot1"
    assert fenced.message.body == Fenced(TERM, Term(6, 2, 1))
    assert rig.command(1, Twist(0.5, 0.0), as_leader=True) != [], "refused, and told"
    rig.run(1.0)
    assert rig.truth().robots[0].linear_x == 0.0
    assert last(rig.said, Sensors, "robot1").term_max == Term(6, 2, 1)


def test_a_dropped_token_latches_the_gateway_of_that_robot_only() -> None:
    rig = Rig().opened()
    rig.run(0.5, Twist(0.1, 0.0))
    rig.hear("", PeerDown("robot1", 1))
    rig.run(0.1)
    assert [last(rig.said, Sensors, f"robot{n}").latched for n in (1, 2)] == [True, False]


def test_tokens_that_drop_with_the_worlds_own_link_latch_nobody() -> None:
    rig = Rig().opened()
    rig.run(0.5, Twist(0.1, 0.0))
    rig.hear("", RouterLost())
    rig.hear("", PeerDown("robot1", 1))
    rig.run(0.1)
    assert not last(rig.said, Sensors, "robot1").latched
    rig.hear("", PeerUp("robot1", 1))
    rig.hear("", PeerDown("robot1", 1))
    rig.run(0.1)
    assert last(rig.said, Sensors, "robot1").latched


def test_strangers_on_our_keys_change_nothing() -> None:
    rig = Rig().opened()
    assert (
        rig.hear(
            "robot9/cmd_vel", CmdVel(Header("x", 1, 1, 0.0), Twist(9.0, 9.0), TERM, 9, True, GatewayStamp(9, rig.now))
        )
        == []
    )
    assert rig.hear("robot2/lease/gateway9", LeaseNote(Header("robot2", 1, 1, 0.0), Fence(TERM, TERM))) == []
    assert rig.hear("robot2/ask", Ask(Header("robot2", 1, 1, 0.0), "everything")) == []
    assert rig.hear("", PeerDown("robot77", 1)) == []


def test_the_mission_is_told_at_the_start_and_on_ask() -> None:
    rig = Rig()
    assert len(of(rig.run(0.0), MissionNote)) == 1
    (answer,) = rig.hear("robot2/ask", Ask(Header("robot2", 1, 1, rig.now), "mission"))
    assert answer.key == f"lfa/{FLEET}/world/mission"
    assert isinstance(answer.message, MissionNote)
    assert answer.message.mission == load("straight").mission


def test_after_stop_nothing_moves_and_nothing_is_said() -> None:
    rig = Rig().opened()
    rig.run(1.0, Twist(0.5, 0.0))
    rig.hear("", Stop())
    assert rig.world.finished
    assert rig.world.tick(rig.now + 1.0) == []
    assert rig.command(1, Twist(0.5, 0.0)) == []
