"""What `lfa watch` says of a fleet, from the messages alone."""

from __future__ import annotations

from io import StringIO

import pytest
from msgspec.structs import replace
from rich.console import Console

from lfa.deploy.client.team_status import Board, RobotStatus
from lfa.deploy.view.terminal.topic import expressions
from lfa.deploy.view.terminal.watch import _table
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Role, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Event, Level, PoseStamped, Status, Tracking

LEADING, FOLLOWING = Role.LEADER, Role.FOLLOWER


def _pose(robot: int, role: Role, term: int) -> PoseStamped:
    header = Header(f"robot{robot}", 1, 1, 0.0)
    return PoseStamped(header, 1.0, 2.0, 0.0, 0.0, Twist(0.5, 0.0), 3.0, role, Term(term, robot, 1))


def _tracking(robot: int) -> Tracking:
    header = Header(f"robot{robot}", 1, 1, 0.0)
    return Tracking(header, 1, 1.2, 1.0, 0.0, 0.0, Pose2D(), 0.25, True, "follow")


def _board(*said: tuple[float, Message]) -> Board:
    board = Board((1, 2))
    for at, message in said:
        board.see(at, message)
    return board


def _row(board: Board, robot: int, now: float) -> RobotStatus:
    return next(row for row in board.rows(now) if row.robot == robot)


def test_a_follower_shows_whom_it_follows_and_how_well() -> None:
    row = _row(_board((10.0, _pose(2, FOLLOWING, 3)), (10.0, _tracking(2))), 2, 10.1)
    assert (row.role, row.predecessor, row.error_m, row.state) == ("follower", 1, 0.25, "follow, avoids")


def test_a_follower_turned_away_from_its_heading_shows_by_how_much() -> None:
    row = _row(_board((10.0, _pose(2, FOLLOWING, 3)), (10.0, replace(_tracking(2), heading=-0.2))), 2, 10.1)
    assert row.heading_error_rad == pytest.approx(-0.2)


def test_a_robot_that_fell_silent_is_called_so_and_its_errors_go() -> None:
    row = _row(_board((10.0, _pose(2, FOLLOWING, 3)), (10.0, _tracking(2))), 2, 12.0)
    assert (row.role, row.predecessor, row.pose_age_s) == ("silent", None, 2.0)


def test_of_two_that_claim_to_lead_the_higher_term_does() -> None:
    board = _board((10.0, _pose(1, LEADING, 3)), (10.0, _pose(2, LEADING, 4)))
    assert board.leader(10.1) == 2


def test_the_timeline_says_when_nobody_led() -> None:
    board = _board((10.0, _pose(1, LEADING, 3)))
    for now in (10.0, 10.4, 11.0, 12.1):
        board.sample(now)
    assert list(board.leaders) == [1, None, None]


def test_counters_come_from_the_status() -> None:
    counters = {"loop_lag_ms": 2.0, "cpu_percent": 5.0, "rss_mib": 33.0}
    status = Status(Header("robot2", 1, 1, 0.0), Level.WARN, "waiting for sensors", Role.WAITING, Term(), counters)
    row = _row(_board((10.0, _pose(2, Role.WAITING, 0)), (10.0, status)), 2, 10.0)
    assert (row.loop_lag_ms, row.cpu_percent, row.rss_mib, row.state) == (2.0, 5.0, 33.0, "waiting for sensors")


def test_events_are_told_and_tokens_are_not() -> None:
    event = Event(Header("robot2", 1, 1, 0.0), "chain", Term(), {"chain": [2, 3], "t": 1.0})
    token = Event(Header("recorder", 1, 1, 0.0), "peer_up", None, {})
    assert [happened.what for happened in _board((1.0, event), (1.0, token)).events] == ["chain 2-3"]


def test_a_robot_unheard_of_has_a_row_too() -> None:
    assert _row(_board(), 1, 5.0).role == "unheard"


def test_a_topic_may_be_said_in_three_ways() -> None:
    assert "robot2/pose" in expressions("robot2/pose")
    assert "*/pose" in expressions("pose")
    assert "robot2/*" in expressions("robot2")


@pytest.mark.parametrize("wrong", ["robot2/nonsense", "nonsense", "nobody/pose", "robot2/pose/x"])
def test_a_topic_that_is_none_is_refused(wrong: str) -> None:
    with pytest.raises(Refused, match="robot2 or pose, of mission"):
        expressions(wrong)


def test_the_table_keeps_every_number_whole_on_80_columns() -> None:
    row = RobotStatus(
        10, "follower", 1795717143586, 9, -1.7159, -3.1, -0.25, 12.345, "follow, avoids", 1200.0, 100.0, 135.0
    )
    console = Console(width=80, file=StringIO(), record=True)
    console.print(_table([row], None, 80))
    _, line = console.export_text().splitlines()
    assert line.split()[:11] == ["10", "follower", "3586", "9", "-1716", "-178", "-0.25", "12345", "1200", "100", "135"]
    assert len(line) <= 80


def test_a_robot_that_lost_its_pose_says_so_and_has_no_speed() -> None:
    text = "follower, own pose lost: no odometry"
    status = Status(Header("robot2", 1, 1, 0.0), Level.ERROR, text, Role.FOLLOWER, Term(), {})
    row = _row(_board((10.0, _pose(2, Role.FOLLOWER, 3)), (14.0, status)), 2, 15.0)
    assert (row.role, row.state, row.speed_mps) == ("follower", text, None)
