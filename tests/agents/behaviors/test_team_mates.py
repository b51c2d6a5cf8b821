"""Team-mates: those nearby as what moves, and those to which no controller keeps a distance."""

from __future__ import annotations

import pytest

from lfa.agents.behaviors.team_mates import TeamMates
from lfa.agents.following.predecessor import Predecessor
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import STILL, Pose2D
from lfa.protocol.messages.consensus import NO_TERM, Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import PoseStamped, TableRow


def test_a_team_mate_nearby_moves_as_its_rows_say_and_one_far_off_is_left_out() -> None:
    team = TeamState()
    for robot, y in ((1, 0.0), (2, 1.0), (3, 9.0)):
        for seq in (1, 2):
            header = Header(f"robot{robot}", 1, seq, 0.5 * seq)
            row = TableRow(header, 0.2 * seq, y, 0.0, 0.0, 0.0, Role.FOLLOWER)
            team.hear_row(robot, row, 0.5 * seq)
    (mate,) = TeamMates(1, team).moving(Pose2D(), 2.0, 1.0)
    assert (mate.x, mate.y, mate.radius_m) == (0.4, 1.0, 0.0)
    assert (mate.vx, mate.vy) == pytest.approx((0.4, 0.0))


def test_the_predecessor_is_a_stranger_too_on_a_way_on_which_the_law_keeps_no_distance_to_it() -> None:
    mates = TeamMates(2, TeamState())
    mates.predecessor = Predecessor(1)
    for n in range(3):
        at = 0.02 * n
        header = Header("robot1", 1, n, at)
        mates.predecessor.heard(PoseStamped(header, 1.5, 0.0, 0.0, 0.0, STILL, 0.0, Role.LEADER, NO_TERM), at)
    assert mates.strangers(Pose2D(0.5), 2.0, 0.04) == []
    assert mates.strangers(Pose2D(0.5), 2.0, 0.04, by_law=False) == [pytest.approx((1.0, 0.0))]


def test_a_predecessor_of_which_no_pose_has_come_yet_is_where_its_row_says() -> None:
    team = TeamState()
    team.hear_row(1, TableRow(Header("robot1", 1, 1, 0.0), 1.5, 0.0, 0.0, 0.0, 0.0, Role.FOLLOWER), 0.0)
    mates = TeamMates(2, team)
    mates.predecessor = Predecessor(1)
    assert mates.strangers(Pose2D(0.5), 2.0, 0.04, by_law=False) == [pytest.approx((1.0, 0.0))]
