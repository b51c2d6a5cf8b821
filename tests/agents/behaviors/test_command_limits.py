"""Limits of a command: a robot brakes before where team-mates drive to, and may flee faster than it cruises."""

from __future__ import annotations

import pytest

from lfa.agents.avoidance.safety import sharing_reach_m
from lfa.agents.behaviors.command_limits import CommandLimits
from lfa.agents.behaviors.team_mates import TeamMates
from lfa.agents.localization.estimator import Estimator
from lfa.agents.perception.obstacle_model import ObstacleModel
from lfa.agents.perception.scan import Point
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


def test_a_robot_brakes_before_a_team_mate_that_would_be_in_its_body_within_half_a_second() -> None:
    """As near as that its place of then had counted as no place to brake for."""
    assert speed_beside((0.42, 0.0), (-0.6, 0.0)) == 0.0


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


class FarSight(TeamMates):
    """Team-mates of robot 1 that note how far [m] a robot looks for them."""

    def strangers(self, pose: Pose2D, within_m: float, now: float, *, by_law: bool = True) -> list[Point]:
        self.within_m = within_m
        return super().strangers(pose, within_m, now, by_law=by_law)


@pytest.mark.parametrize("wanted_mps", [1e4, 1e200])
def test_whatever_speed_a_controller_wants_team_mates_are_looked_for_as_far_as_the_drive_needs(
    wanted_mps: float,
) -> None:
    mission, team = Mission(), TeamState()
    obstacles = ObstacleModel(mission.radius_m, mission.limits, team.obstacles)
    mates = FarSight(1, team)
    CommandLimits(mission, mates, ScanAge(), Estimator(), obstacles).slow(
        Twist(wanted_mps, 0.0), Role.FOLLOWER, Pose2D(), 0.0, by_law=True
    )
    fastest = Twist(mission.limits.v_max_mps, 0.0)
    assert mates.within_m == sharing_reach_m(fastest, mission.radius_m, mission.limits)
