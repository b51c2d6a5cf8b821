"""Team-mates as what moves: those nearby, with the velocity that their messages tell."""

from __future__ import annotations

import pytest

from lfa.agents.behaviors.team_mates import TeamMates
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import TableRow


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
