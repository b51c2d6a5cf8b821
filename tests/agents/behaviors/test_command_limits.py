"""Limits of a command: a robot brakes before where team-mates drive to, and may flee faster than it cruises."""

from __future__ import annotations

import pytest

from lfa.agents.behaviors.command_limits import CommandLimits
from lfa.agents.behaviors.team_mates import TeamMates
from lfa.agents.localization.estimator import Estimator
from lfa.agents.perception.obstacle_model import ObstacleModel
from lfa.agents.perception.scan_age import ScanAge
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import TableRow
from lfa.protocol.mission import Leading, Mission

AHEAD = Twist(0.21, 0.0)


def speed_beside(mate: tuple[float, float], velocity: tuple[float, float], wanted: Twist = AHEAD) -> float:
    """Return the speed [m/s] that is left of `wanted` at the origin, where robot 4 is at `mate` and drives on."""
    mission, team = Mission(), TeamState()
    for seq in (1, 2):
        x, y = (mate[n] + (seq - 2) * 0.2 * velocity[n] for n in (0, 1))
        team.hear_row(4, TableRow(Header("robot4", 1, seq, 0.2 * seq), x, y, 0.0, 0.0, 0.0, Role.FOLLOWER), 0.2 * seq)
    obstacles = ObstacleModel(mission.radius_m, mission.limits, team.obstacles)
    limits = CommandLimits(mission, TeamMates(1, team), ScanAge(), Estimator(), obstacles)
    return limits.brake(wanted, wanted, [], [], Pose2D(), 1.0, 0.4).linear_x


def test_a_robot_brakes_before_the_place_that_a_team_mate_crosses_next() -> None:
    """Robot 4 is beside the way ahead, and in half a second on it: both drove on, and touched."""
    assert speed_beside((0.21, 0.36), (0.0, -0.27)) < 0.1


@pytest.mark.parametrize(
    ("mate", "velocity"),
    [((0.5, 0.0), (0.3, 0.0)), ((0.21, 0.40), (0.0, 0.0)), ((-0.5, 0.0), (0.3, 0.0)), ((0.1, 0.5), (0.21, 0.0))],
    ids=["drives ahead", "stands beside the way", "comes from behind", "drives beside it"],
)
def test_a_robot_is_not_braked_for_a_team_mate_that_does_not_come_in_its_way(
    mate: tuple[float, float], velocity: tuple[float, float]
) -> None:
    assert speed_beside(mate, velocity) == AHEAD.linear_x


def test_a_leader_flees_from_what_moves_faster_than_it_cruises() -> None:
    mission, team = Mission(leading=Leading(route_m=((0.0, 0.0), (9.0, 0.0)), cruise_mps=0.4)), TeamState()
    obstacles = ObstacleModel(mission.radius_m, mission.limits, team.obstacles)
    limits = CommandLimits(mission, TeamMates(1, team), ScanAge(), Estimator(), obstacles)
    flees = Twist(0.7, 0.3)
    assert limits.slow(flees, Role.LEADER, Pose2D(), 0.0, by_law=False) == flees
