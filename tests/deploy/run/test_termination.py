"""When a run is over: one claim a rule."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from lfa.deploy.run.termination import GAVE_WAY_S, REST_S, Termination
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Role, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.orders import OrderNote, TeamOrder
from lfa.protocol.messages.simulation import TrueRobot, Truth
from lfa.protocol.messages.team import Event, Level, RouteProgress, Status, TableRow, Tracking
from lfa.protocol.mission import FormationSpec
from lfa.world.description.load import Scenario, load


def _scenario() -> Scenario:
    return load("straight", ["mission.leading.route_m=[[3.0, 0.0]]", "time_limit_s=20.0"], robots=2)


def _truth(
    time_s: float, leader_x: float, speed: float = 0.0, follower_turns: float = 0.0, follower_x: float = 2.3
) -> Truth:
    robots = (TrueRobot(1, leader_x, 0.0, 0.0, speed, 0.0), TrueRobot(2, follower_x, 1.0, 0.0, 0.0, follower_turns))
    return Truth(Header("world", 1, 1, time_s), time_s, robots)


def _event(kind: str, sender: str, term: Term | None, **data: object) -> Event:
    return Event(Header(sender, 1, 1, 0.0), kind, term, data)


def _row(waypoint: int, robot: int = 1, route: int = 0) -> TableRow:
    header = Header(f"robot{robot}", 1, 1, 0.0)
    return TableRow(header, 0.0, 0.0, 0.0, 0.0, 0.0, Role.LEADER, progress=RouteProgress(waypoint, 0.0, route))


def _tracking(error_m: float = 0.0, predecessor: int = 1) -> Tracking:
    return Tracking(
        Header("robot2", 1, 1, 0.0), predecessor, 1.2, 0.0, 0.0, 0.0, Pose2D(), error_m, avoiding=False, state="stand"
    )


IN_SLOT = _tracking()


def _outcome(*messages: Message, waypoint: int = 1, tracking: Tracking | None = IN_SLOT, route: int = 0) -> str | None:
    """The outcome after `messages`, where leader and follower report before each ground truth."""
    termination = Termination(_scenario())
    termination.see(_truth(8.5, 2.0, speed=0.5))
    for message in messages:
        for said in (
            (_row(waypoint, 1, route), _row(waypoint, 2, route), tracking) if isinstance(message, Truth) else ()
        ):
            if said is not None:
                termination.see(said)
        termination.see(message)
    return None if termination.verdict is None else termination.verdict.outcome


def test_all_at_rest_at_the_goal_for_half_a_second_is_the_goal() -> None:
    assert _outcome(_truth(9.0, 2.95), _truth(9.0 + REST_S, 2.95)) == "goal_reached"


def test_a_leader_that_has_not_driven_the_whole_route_has_not_arrived_wherever_it_stands() -> None:
    assert _outcome(_truth(9.0, 2.95), _truth(9.0 + REST_S, 2.95), waypoint=0) is None


def test_a_goal_that_an_operator_gave_is_the_one_to_reach() -> None:
    """E32: the leader carries another route; progress along the old one does not count."""
    leading = replace(_scenario().mission.leading, route_m=((8.0, 0.0),))
    order = OrderNote(Header("robot1", 1, 1, 0.0), TeamOrder(leading, FormationSpec(), 1, 1), Term(1, 1, 1))
    old = (_truth(9.0, 2.95), _truth(9.0 + REST_S, 2.95))
    assert _outcome(replace(order, term=None), *old) == "goal_reached", "nobody carries out what is only proposed"
    assert _outcome(order, *old) is None
    there = [_truth(t, 8.05, follower_x=7.3) for t in (9.0, 9.0 + REST_S)]
    assert _outcome(order, *there) is None, "the progress is that of the old route"
    assert _outcome(order, *there, route=1) == "goal_reached"


def test_a_robot_at_rest_off_its_slot_keeps_the_run_going() -> None:
    at_rest = (_truth(9.0, 2.95), _truth(9.0 + REST_S, 2.95))
    assert _outcome(*at_rest, tracking=_tracking(error_m=0.7)) is None
    assert _outcome(*at_rest, tracking=_tracking(predecessor=3)) is None


def test_a_robot_that_reports_to_be_in_its_slot_and_is_far_from_it_keeps_the_run_going() -> None:
    far = [_truth(t, 2.95, follower_x=-3.0) for t in (9.0, 9.0 + REST_S)]
    assert _outcome(*far) is None


def test_a_robot_that_reports_no_tracking_is_in_no_slot() -> None:
    assert _outcome(_truth(9.0, 2.95), _truth(9.0 + REST_S, 2.95), tracking=None) is None


def test_the_time_limits_reason_says_who_was_missing() -> None:
    termination = Termination(_scenario())
    termination.see(_row(1))
    verdict = termination.see(_truth(20.0, 2.95))
    assert verdict is not None
    assert verdict.reason == "not at the goal after 20 s: robot 2 is not in its slot"


@pytest.mark.parametrize(
    ("about", "at_s", "why"),
    [
        ("moving", 17.0, " (it gave way to what moves 3 s before)"),
        ("moving", 20.0 - GAVE_WAY_S - 0.5, ""),
        ("wall", 17.0, ""),
    ],
)
def test_the_time_limits_reason_tells_of_who_gave_way_of_late(about: str, at_s: float, why: str) -> None:
    """A slot that lies where something roams is left again and again."""
    termination = Termination(_scenario())
    for said in (_row(1), _truth(at_s, 2.95), _event("decision", "robot2", None, action="right", **{"class": about})):
        termination.see(said)
    verdict = termination.see(_truth(20.0, 2.95, follower_turns=0.3))
    assert verdict is not None
    assert verdict.reason == f"not at the goal after 20 s: robot 2 moves{why}"


def test_a_short_rest_is_not_yet_the_goal() -> None:
    assert _outcome(_truth(9.0, 2.95), _truth(8.9 + REST_S, 2.95)) is None


def test_a_follower_that_still_turns_keeps_the_run_going() -> None:
    assert _outcome(_truth(9.0, 2.95, follower_turns=0.01), _truth(10.0, 2.95, follower_turns=0.01)) is None


def test_a_rest_that_was_interrupted_starts_anew() -> None:
    still = (_truth(9.0, 2.95), _truth(9.4, 2.95, speed=0.1), _truth(9.6, 2.95), _truth(9.9, 2.95))
    assert _outcome(*still) is None


def test_rest_away_from_the_goal_is_no_goal() -> None:
    assert _outcome(_truth(9.0, 2.0), _truth(10.0, 2.0)) is None


def test_who_is_no_longer_in_the_chain_need_not_rest() -> None:
    alone = _event("chain", "robot2", Term(2, 2, 1), chain=[2])
    moving = [replace(_truth(t, 0.0, speed=1.0), robots=(TrueRobot(1, 0.0, 0.0, 0.0, 1.0, 0.0),
              TrueRobot(2, 3.0, 0.0, 0.0, 0.0, 0.0))) for t in (9.0, 9.5)]  # fmt: skip
    assert _outcome(alone, *moving) == "goal_reached"


def test_an_older_terms_chain_changes_nothing() -> None:
    newer = _event("chain", "robot1", Term(3, 1, 1), chain=[1, 2])
    older = _event("chain", "robot2", Term(2, 2, 1), chain=[2])
    assert _outcome(newer, older, _truth(9.0, 2.95), _truth(9.5, 2.95)) == "goal_reached"


def test_the_time_limit_is_the_worlds() -> None:
    assert _outcome(_truth(19.98, 1.0, speed=0.5)) is None
    assert _outcome(_truth(20.0, 1.0, speed=0.5)) == "time_limit"


def test_an_agent_that_gives_up_fails_the_run() -> None:
    termination = Termination(_scenario())
    verdict = termination.see(_event("failed", "robot2", None, reason="stuck at (1.0, 2.0)"))
    assert verdict is not None
    assert (verdict.outcome, verdict.reason) == ("failed", "robot 2: stuck at (1.0, 2.0)")


def test_events_with_foreign_data_do_no_harm() -> None:
    termination = Termination(_scenario())
    for data in ({}, {"chain": "all"}, {"chain": [None]}, {"robot": "x"}):
        termination.see(_event("chain", "robot2", Term(9, 1, 1), **data))
        termination.see(_event("leader_command", "world", Term(9, 1, 1), **data))
    assert termination.chain == (1, 2)
    assert termination.leader is None


def test_a_chain_whose_event_was_missed_is_learned_from_the_leaders_status() -> None:
    """Robot 1 is gone, and the event of the chain without it was lost: the run must not end by its time limit."""
    status = Status(Header("robot2", 1, 1, 0.0), Level.OK, "", Role.LEADER, Term(4, 2, 1), {}, (2,))
    termination = Termination(_scenario())
    termination.see(_event("chain", "robot1", Term(2, 1, 1), chain=[1, 2], seq=0))
    for message in (status, _row(1, 2), _truth(9.0, 1.0, follower_x=2.95), _truth(9.0 + REST_S, 1.0, follower_x=2.95)):
        termination.see(message)
    assert (termination.chain, termination.leader) == ((2,), 2)


def test_a_leader_of_an_earlier_term_changes_no_chain() -> None:
    termination = Termination(_scenario())
    termination.see(_event("chain", "robot2", Term(4, 2, 1), chain=[2], seq=0))
    termination.see(Status(Header("robot1", 1, 1, 0.0), Level.OK, "", Role.LEADER, Term(2, 1, 1), {}, (1, 2)))
    assert termination.chain == (2,)
