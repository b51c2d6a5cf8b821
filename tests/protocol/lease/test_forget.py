"""Where no quorum can be had: by an operator's word (E20), or alone (E21)."""

from __future__ import annotations

from lfa.protocol.mission import Leading, Mission
from tests.rigs.lease_scenes import TEAM, Team


def blacked_out(*remembering: int, off: tuple[int, ...] = (4,)) -> Team:
    """Everybody has lost its memory but for those `remembering`, and `off` stay off."""
    team = Team()
    for robot_id in team.ids:
        if robot_id not in remembering:
            team.kill(robot_id)
    for robot_id in team.ids:
        if robot_id not in (*remembering, *off):
            team.start(robot_id)
    team.run(4.0)
    assert team.leaders() == []
    return team


def test_e20_a_fleet_that_lost_its_memory_goes_on_without_whom_the_operator_declares_dead() -> None:
    team = blacked_out(3)
    lost = team.processes[4].member
    team.forget(lost)
    team.run(5.0)
    assert len(team.leaders()) == 1
    assert sorted(team.lease_of(3).chain) == [1, 2, 3]
    team.start(4)
    team.run(7.0)
    assert team.lease_of(3).chain[-1] == 4, "a later life of it joins as anybody does"
    assert team.safe()


def test_e20_several_may_be_forgotten_at_once() -> None:
    team = blacked_out(3, off=(1, 2, 4))
    team.forget(*(team.processes[i].member for i in (1, 2, 4)))
    team.run(5.0)
    assert team.leaders() == [3]
    assert team.safe()


def test_e20_the_word_holds_for_one_attempt() -> None:
    """Robot 2 is off as well, and comes when the attempt is over: then robot 4 is needed again."""
    team = blacked_out(3, off=(2, 4))
    team.forget(team.processes[4].member)
    team.run(6.0)
    assert team.leaders() == []
    team.start(2)
    team.run(9.0)
    assert team.leaders() == []
    assert team.safe()


def test_e20_whoever_heard_a_later_life_of_it_refuses() -> None:
    team = blacked_out(3)
    dead = team.processes[4].member
    team.start(4)
    team.run(4.1)
    team.cut((4,))
    team.forget(dead)
    team.run(7.0)
    assert team.leaders() == []
    assert team.safe()


def test_e20_nobody_is_forgotten_where_somebody_leads() -> None:
    team = Team()
    team.forget(team.processes[4].member)
    team.run(2.0)
    assert team.changes() == []
    assert team.lease_of(2).chain == (1, 2, 3, 4)


LONELY = Mission(
    robots=(1, 2, 3, 4), lonely="continue_after", continue_after_s=3.0, leading=Leading(route_m=((1.0, 0.0),))
)


def left_alone(mission: Mission = LONELY) -> Team:
    """Three of four die at once: no quorum is left."""
    team = Team(mission=mission, gateways_at_world=True)
    for victim in (1, 2, 3):
        team.kill(victim)
    team.run(3.9)
    assert team.leaders() == []
    return team


def test_e21_the_last_robot_goes_on_alone_when_all_other_gateways_refuse_what_is_below() -> None:
    team = left_alone()
    team.run(5.0)
    assert team.leaders() == [4]
    term = team.lease_of(4).term
    assert all(team.gateways[i].gateway.term_max == term for i in (1, 2, 3)), "each is fenced"
    for robot_id in (1, 2, 3):
        team.start(robot_id)
    team.run(8.0)
    assert team.leaders() == [4]
    assert sorted(team.lease_of(1).chain) == [1, 2, 3, 4]
    assert team.safe()


def test_e21_while_one_gateway_does_not_answer_it_stays_where_it_is() -> None:
    team = left_alone()
    team.kill_gateway(2)
    team.run(9.0)
    assert team.leaders() == []
    assert team.safe()


def test_e21_nobody_is_lonely_by_default() -> None:
    team = left_alone(TEAM)
    team.run(20.0)
    assert team.leaders() == []


def test_e21_two_without_a_quorum_go_on_together_and_make_one_chain_with_the_others_again() -> None:
    team = Team(mission=LONELY)  # each gateway with its robot: the parts cannot fence each other ...
    team.cut((3, 4))
    team.run(9.0)
    assert team.leaders() == [1], "... so those without a quorum stay"
    team.heal()
    team.run(12.0)
    assert sorted(team.lease_of(4).chain) == [1, 2, 3, 4]
    assert team.safe()


def test_e21_whom_a_voter_tells_of_a_lease_is_not_lonely() -> None:
    team = Team(mission=LONELY, gateways_at_world=True)
    team.part({(a, b) for a in (1, 2) for b in (3, 4)} | {(a, b) for a in (3, 4) for b in (1, 2)})
    team.run(9.0)
    assert team.leaders() == [1]
    assert {who for who, _ in team.changes()} <= {1}
    assert team.safe()
