"""The leader's patience with its team: a gap that grows slows it, a wide one stops it, and not for ever."""

import pytest

from lfa.agents.formation.formation import Formation
from lfa.agents.leading.leader import GAP_WAIT_S_MAX, Leadership
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import STILL, Pose2D
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import TableRow
from lfa.protocol.mission import Mission
from lfa.world.description.load import load

HERE = Pose2D(5.0, 0.0, 0.0)


def share_of(gap_in_k: float, since_s: float | None = None) -> float:
    """Its share of the cruise speed with a follower so far behind: at once, or from `since_s` ago on."""
    mission: Mission = load("straight").mission
    leader = Leadership(mission, Formation.of(mission), team := TeamState())
    leader.begin(HERE, 0.0, 0.0)
    behind = HERE.x - gap_in_k * mission.formation.separation_m
    for seq, now in enumerate([0.0] if since_s is None else [0.0, since_s]):
        team.hear_row(2, TableRow(Header("robot2", 1, seq, now), behind, 0.0, 0.0, 0.0, 0.0, Role.FOLLOWER), now)
        leader.step((1, 2), HERE, STILL, now)
    return leader._patience((1, 2), HERE, now)


@pytest.mark.parametrize(("gap", "share"), [(1.0, 1.0), (1.5, 1.0), (1.75, 0.75), (2.0, 0.5), (2.01, 0.0)])
def test_a_leader_slows_as_a_gap_grows_and_stands_beyond_2_k(gap: float, share: float) -> None:
    assert share_of(gap) == pytest.approx(share)


def test_a_leader_waits_15_s_and_then_goes_on_slowly() -> None:
    assert GAP_WAIT_S_MAX == 15.0
    assert share_of(3.0, since_s=14.9) == 0.0
    assert share_of(3.0, since_s=15.1) == 0.5


def test_a_leader_is_under_way_but_where_its_team_has_it_wait() -> None:
    mission = load("trajectory").mission
    leader = Leadership(mission, Formation.of(mission), team := TeamState())
    leader.begin(Pose2D(), 0.0, 0.0)
    leader.step((1,), Pose2D(), STILL, 0.0)
    assert leader.under_way
    far = TableRow(Header("robot2", 1, 0, 0.0), -9.0, 0.0, 0.0, 0.0, 0.0, Role.FOLLOWER)
    team.hear_row(2, far, 0.0)
    leader.step((1, 2), Pose2D(), STILL, 0.0)
    assert not leader.under_way
