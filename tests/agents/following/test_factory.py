"""Followers by mission: how far the formation's heading is filtered, and which distance the collision guard keeps."""

from __future__ import annotations

from math import pi
from typing import Literal

import pytest

from lfa.agents.following.factory import follower_of, gains_of, heading_filter_of, predecessor_of
from lfa.agents.following.predecessor import DELAY_MIN_S, Predecessor
from lfa.protocol.geometry import Twist
from lfa.protocol.messages.consensus import NO_TERM, Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import PoseStamped
from lfa.protocol.mission import Following, FormationSpec, Mission


@pytest.mark.parametrize(
    ("robots", "side", "given_m", "filter_m"),
    [
        (4, "left", 0.0, 0.0),
        (5, "left", 0.0, 0.6),
        (5, "right", 0.0, 0.6),
        (12, "column", 0.0, 1.2),
        (12, "left", 0.1, 0.1),
        (3, "left", 0.36, 0.36),
    ],
)
def test_a_chain_of_more_than_three_followers_is_not_rigid(
    robots: int, side: str, given_m: float, filter_m: float
) -> None:
    spec = FormationSpec(2.0, pi / 3, side, given_m)  # type: ignore[arg-type]
    mission = Mission(robots=tuple(range(1, robots + 1)), formation=spec)
    assert heading_filter_of(mission) == pytest.approx(filter_m)


def test_on_a_trace_there_is_nothing_to_filter() -> None:
    mission = Mission(robots=tuple(range(1, 13)), following=Following(trace=True))
    assert heading_filter_of(mission) == 0.0


@pytest.mark.parametrize(
    ("radius_m", "separation_m", "d_min_m"),
    [(0.15, 1.2, 0.45), (0.25, 0.8, 0.65), (0.333, 0.8, 0.7), (0.15, 0.5, 0.45)],
)
def test_the_collision_guard_keeps_bodies_apart_and_lets_each_follower_into_its_slot(
    radius_m: float, separation_m: float, d_min_m: float
) -> None:
    mission = Mission(robots=(1, 2), radius_m=radius_m, formation=FormationSpec(separation_m))
    assert gains_of(mission).d_min_m == pytest.approx(d_min_m)


def test_gains_that_a_mission_names_hold_as_they_are() -> None:
    mission = Mission(robots=(1, 2), radius_m=0.4, following=Following(gains={"d_min_m": 0.3}))
    assert gains_of(mission).d_min_m == 0.3


@pytest.mark.parametrize(
    ("followers", "given_s", "delay_s"), [(3, None, 0.0), (4, None, DELAY_MIN_S), (3, 0.2, 0.2), (12, 0.2, 0.2)]
)
def test_a_short_chain_uses_the_present_state_and_a_long_one_that_of_a_while_ago(
    followers: int, given_s: float | None, delay_s: float
) -> None:
    mission = Mission(following=Following(delay_s=given_s))
    assert predecessor_of(mission, 1, followers).delay_s == delay_s


def seen_later(observer: Literal["velocity", "pose", "paper"], followers: int = 3) -> float:
    """Where [m] a predecessor is taken to be 0.1 s after its first pose, at 1 m, in which it drives at 0.5 m/s."""
    predecessor = predecessor_of(Mission(following=Following(observer=observer)), 1, followers)
    predecessor.heard(
        PoseStamped(Header("robot1", 1, 0, 5.0), 1.0, 0.0, 0.0, 0.0, Twist(0.5, 0.0), 0.0, Role.LEADER, NO_TERM), 5.0
    )
    sighting = predecessor.at(5.1)
    assert sighting is not None
    return sighting.pose.x


def test_the_velocity_that_a_predecessor_tells_is_used_unless_the_mission_goes_by_poses() -> None:
    assert seen_later("velocity") == pytest.approx(1.05)
    assert seen_later("pose") == pytest.approx(1.0)


@pytest.mark.parametrize("followers", [3, 12])
def test_the_papers_observer_uses_each_pose_as_received(followers: int) -> None:
    assert seen_later("paper", followers) == pytest.approx(1.0)
    assert predecessor_of(Mission(following=Following(observer="paper")), 1, followers).delay_s == 0.0


def test_a_robot_that_takes_anothers_place_goes_on_along_the_trace_that_is_known() -> None:
    before = Predecessor(1)
    assert predecessor_of(Mission(), 2, 3, before).trace is before.trace
    assert predecessor_of(Mission(), 2, 3).trace is not before.trace


@pytest.mark.parametrize(("observer", "papers"), [("velocity", False), ("pose", False), ("paper", True)])
def test_the_slots_velocity_is_the_papers_estimate_where_the_mission_says_so(
    observer: Literal["velocity", "pose", "paper"], papers: bool
) -> None:
    assert (follower_of(Mission(following=Following(observer=observer)))._paper is not None) == papers
