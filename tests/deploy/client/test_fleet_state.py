"""The one state of a fleet that all views read: who leads, who follows whom, and what any sender may write in it."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import pytest
from msgspec import structs

from lfa.deploy.client.fleet_state import FleetState
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Role, Term
from lfa.protocol.messages.fleet import HostStatus
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Event, Level, PoseStamped, Status, Tracking

TERM = Term(7, 1, 1)


def _header(sender: str) -> Header:
    return Header(sender, 1, 1, 0.0)


def _pose(robot: int, role: Role, number: int = 7) -> PoseStamped:
    return PoseStamped(_header(f"robot{robot}"), 0.0, 0.0, 0.0, 0.0, Twist(), 0.0, role, Term(number, robot, 1))


def _follows(robot: int, ahead: int) -> Tracking:
    return Tracking(_header(f"robot{robot}"), ahead, 1.0, 0.0, 0.0, 0.0, Pose2D(), 0.0, False, "keep")


def _adopts(robot: int, chain: Any, seq: Any = 3, term: Term | None = TERM) -> Event:
    return Event(_header(f"robot{robot}"), "chain", term, {"chain": chain, "seq": seq})


def _status(robot: int, **counters: float) -> Status:
    return Status(_header(f"robot{robot}"), Level.OK, "", Role.FOLLOWER, TERM, counters)


def _state(*messages: Message, at: float = 0.0) -> FleetState:
    state = FleetState()
    for message in messages:
        state.update(at, message)
    return state


CHAIN = (_pose(1, Role.LEADER), _pose(2, Role.FOLLOWER), _pose(3, Role.FOLLOWER), _follows(2, 1), _follows(3, 2))


def test_the_chain_goes_from_the_leader_to_each_that_follows_a_member() -> None:
    assert _state(*CHAIN).chain(0.5) == (1, 2, 3)
    assert _state(*CHAIN, _follows(2, 9)).chain(0.5) == (1,)


def test_a_follower_that_was_stopped_before_its_first_step_is_in_the_chain_of_its_status() -> None:
    said = structs.replace(_status(3), chain=(1, 2, 3))
    assert _state(*CHAIN[:-1], said).chain(0.5) == (1, 2, 3)
    assert _state(*CHAIN[:-1]).chain(0.5) == (1, 2)
    assert _state(*CHAIN[:-1], _pose(3, Role.WAITING), said).chain(0.5) == (1, 2)
    assert _state(*CHAIN, _follows(3, 9), said).chain(0.5) == (1, 2), "what it tracks counts first"


def test_followers_in_a_ring_are_no_chain_without_end() -> None:
    assert _state(*CHAIN, _follows(1, 3)).chain(0.5) == (1, 2, 3)


def test_of_two_that_claim_to_lead_the_higher_term_comes_last() -> None:
    state = _state(_pose(2, Role.LEADER, 8), _pose(1, Role.LEADER, 7))
    assert (state.leaders(0.5), state.leader(0.5)) == ([1, 2], 2)


def test_a_pose_that_is_a_second_old_neither_leads_nor_follows() -> None:
    assert (_state(*CHAIN).leader(1.0), _state(*CHAIN).chain(1.0)) == (None, ())


def test_a_robot_that_is_forgotten_says_nothing_any_more() -> None:
    state = _state(*CHAIN, _adopts(1, [1, 2, 3]))
    state.forget(1)
    assert (state.leader(0.5), state.chains) == (None, {})


def test_a_robot_whose_chain_event_was_lost_has_the_chain_of_one_with_the_same_version() -> None:
    state = _state(
        _adopts(1, [1, 2]), _status(2, config_n=7.0, config_seq=3.0), _status(3, config_n=7.0, config_seq=4.0)
    )
    assert state.chains.get(2) == state.chains[1]
    assert 3 not in state.chains


def test_a_host_speaks_for_itself_only() -> None:
    status = HostStatus(_header("host-b"), "a", "0", "r", (0, 0), ())
    assert _state(status).hosts == {}


@pytest.mark.parametrize("chain", [None, 3, "12", [[1], {}], {"1": 2}, [None, 2.5]])
@pytest.mark.parametrize("seq", [3, None, "x", [1]])
def test_no_event_of_any_sender_ends_a_view(chain: object, seq: object) -> None:
    state = _state(_adopts(1, [1, 2]), _adopts(2, chain, seq), _adopts(3, [1], 3, None), _status(2, config_n=7.0))
    assert state.chains[1].chain == (1, 2)
    assert len({state.chains.get(robot) for robot in (1, 2, 3)}) >= 1


def test_what_robots_refused_of_a_member_is_summed_and_what_is_no_number_is_left_out() -> None:
    state = _state(
        _status(1, refused_of_robot3=7.0, dropped=9.0),
        _status(2, refused_of_robot3=5.0, refused_of_operator=nan),
        _status(4, refused_of_robot3=inf, refused_of_x=-1.0),
    )
    assert state.refused() == {"robot3": 12}
