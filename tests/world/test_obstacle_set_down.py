"""An obstacle set down during a run is a body like the scenario's own: seen, met, remembered."""

from __future__ import annotations

from math import inf, nan

import msgspec
import pytest

from lfa.protocol.geometry import Twist
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.messages.team import OperatorNote
from lfa.world import checkpoint
from lfa.world.physics.kinematics import Kinematic
from lfa.world.world import World
from tests.rigs.world_rig import FLEET, Rig, events, last


def order(rig: Rig, **place: object) -> None:
    rig.hear("operator/operator", OperatorNote(Header("operator", 1, 1, rig.now), "obstacle", place))


def ahead(rig: Rig) -> float:
    """Least range [m] that robot 1 sees ahead of it."""
    ranges = last(rig.said, LaserScan, "robot1").ranges_m
    return float(ranges[len(ranges) // 2])


def test_robots_see_it_and_drive_into_it() -> None:
    rig = Rig().opened()
    assert ahead(rig) == inf
    order(rig, x=1.0, y=0.0, radius_m=0.3)
    assert events(rig.said, "obstacle")[0].data["index"] == 0
    rig.run(0.2)
    assert ahead(rig) == pytest.approx(0.7, abs=0.01)
    rig.run(4.0, Twist(0.5, 0.0))
    assert rig.truth().robots[0].x == pytest.approx(1.0 - 0.3 - 0.15, abs=0.01)
    assert events(rig.said, "contact")[0].data["other"] == "obstacle0"


def test_on_top_of_a_robot_it_is_refused() -> None:
    rig = Rig().opened()
    order(rig, x=0.3, y=0.0, radius_m=0.3)
    (told,) = events(rig.said, "obstacle")
    assert told.data["refused"] == "robot 1 stands there"
    rig.run(0.2)
    assert ahead(rig) == inf


@pytest.mark.parametrize(
    "place",
    [
        {}, {"x": 1.0, "y": 0.0}, {"x": "1", "y": 0.0, "radius_m": 0.3}, {"x": nan, "y": 0.0, "radius_m": 0.3},
        {"x": 1.0, "y": inf, "radius_m": 0.3}, {"x": 1.0, "y": 0.0, "radius_m": nan},
        {"x": 1.0, "y": 0.0, "radius_m": -1.0}, {"x": 1.0, "y": 0.0, "radius_m": 1e9},
    ],
)  # fmt: skip
def test_an_order_that_is_none_adds_nothing(place: dict[str, object]) -> None:
    rig = Rig().opened()
    order(rig, **place)
    assert events(rig.said, "obstacle") == []
    rig.run(0.2)
    assert ahead(rig) == inf


def test_a_world_that_starts_again_has_it_still() -> None:
    rig = Rig(MOVED).opened()
    order(rig, x=1.0, y=0.0, radius_m=0.3)
    memory = msgspec.json.decode(msgspec.json.encode(rig.world.memory()), type=checkpoint.Memory)
    scenario = checkpoint.resumed(rig.world._scenario, memory)
    assert [obstacle.center_m for obstacle in scenario.world.obstacles] == [(9.0, 9.0), (1.0, 0.0)]
    second = World(FLEET, scenario, 1, 10, start_at=0.0, memory=memory)
    second.tick(0.0)
    assert second.memory().added == memory.added


def test_bodies_without_collisions_take_it_too() -> None:
    rig = Rig(bodies=Kinematic).opened()
    order(rig, x=1.0, y=0.0, radius_m=0.3)
    rig.run(0.2)
    assert ahead(rig) == pytest.approx(0.7, abs=0.01)


MOVED = "world.obstacles=[{center_m=[9,9], radius_m=0.3, mass_kg=1.0}]"
