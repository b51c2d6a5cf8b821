"""The world as a Node: an absolute grid of time."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from random import Random

import pytest

from lfa.protocol.geometry import Twist, along_arc, distance
from lfa.protocol.messages.robot import GroundProfile, LaserScan, Sensors
from lfa.protocol.messages.simulation import Clock, Truth
from lfa.protocol.node import Vitals
from lfa.protocol.runtime.lateness import LATE_SECONDS
from lfa.world.description.load import load
from lfa.world.time_grid import CATCH_UP_STEPS_MAX
from lfa.world.world import World
from tests.rigs.world_rig import FAR_BUMP, FLEET, MOVER, NOISE, T0, Rig, events, of


def test_every_topic_comes_at_its_rate_for_every_robot() -> None:
    said = Rig(FAR_BUMP).run(10.0 - 0.005)
    count = Counter((e.key.split("/")[2], e.key.split("/")[3]) for e in said)
    for robot in ("robot1", "robot2", "robot3", "robot4"):
        assert [count[robot, topic] for topic in ("sensors", "localization", "scan", "ground")] == [500, 100, 100, 200]
    assert (count["sim", "truth"], count["sim", "clock"], count["world", "mission"]) == (500, 10, 1)


def test_a_world_without_terrain_has_no_ground_sensors() -> None:
    assert of(Rig().run(1.0), GroundProfile) == []


@pytest.mark.parametrize("physics_hz", [100.0, 130.0, 250.0])
def test_rates_do_not_depend_on_the_physics_rate(physics_hz: float) -> None:
    said = Rig(f"world.physics_hz={physics_hz}", FAR_BUMP).run(4.0 - 0.001)
    assert len(of(said, Sensors, "robot1")) == 200
    assert len(of(said, LaserScan, "robot1")) == 40
    assert len(of(said, GroundProfile, "robot1")) == 80


def test_sensors_are_stamped_with_the_moment_that_their_state_belongs_to() -> None:
    rig = Rig().opened()
    rig.run(3.0, Twist(0.5, 0.2))
    checked = 0
    readings = of(rig.said, Sensors, "robot1")
    for before, after in pairwise(readings):
        if before.twist == after.twist == Twist(0.5, 0.2):
            elapsed_s = after.header.stamp - before.header.stamp
            assert distance(along_arc(before.pose_odom, before.twist, elapsed_s), after.pose_odom) < 1e-9
            checked += 1
    assert checked > 50


def test_a_late_tick_changes_neither_states_nor_stamps() -> None:
    """However irregularly the loop wakes up: the same bodies at the same points of the grid."""
    punctual, late, chance = Rig(NOISE, MOVER), Rig(NOISE, MOVER), Random(1)
    late.run(0.0)
    punctual.run(5.0)
    while late.now < T0 + 5.0 - 1e-9:
        late.now = min(T0 + 5.0, late.now + chance.uniform(0.001, 0.15))
        late.said += late.world.tick(late.now)
    assert of(late.said, Truth) == of(punctual.said, Truth)
    assert of(late.said, LaserScan) == of(punctual.said, LaserScan)


def test_catching_up_is_bounded_and_the_rest_is_time_stood_still() -> None:
    rig = Rig()
    rig.run(1.0)
    rig.now += 5.0
    said = rig.world.tick(rig.now)
    assert rig.world.slowed_s == pytest.approx(5.0 - 0.01 * CATCH_UP_STEPS_MAX)
    assert events(said, "slowed")[0].data["stood_still_s"] == pytest.approx(rig.world.slowed_s)
    assert len(of(said, Truth)) == CATCH_UP_STEPS_MAX // 2
    assert rig.world.next_deadline() == pytest.approx(rig.now + 0.01)
    assert of(said, Truth)[-1].header.stamp == pytest.approx(rig.now, abs=0.02)


def test_without_a_start_the_worlds_time_begins_with_its_first_tick() -> None:
    world = World(FLEET, load("straight"), 1, 9)
    assert world.next_deadline() < 0.0
    clocks = of(world.tick(77.7), Clock)
    assert [clock.time_s for clock in clocks] == [0.0]
    assert world.next_deadline() == pytest.approx(77.71)


def test_a_world_that_is_late_for_seconds_says_so_once_and_that_it_keeps_time_again() -> None:
    rig = Rig()
    rig.run(0.1)
    lags_s = (*[0.3] * (LATE_SECONDS + 2), *[0.0] * (LATE_SECONDS + 2))
    told = [event for lag_s in lags_s for event in events(rig.hear("", Vitals(lag_s, 0, 0, 0.0, 0.0)), "late")]
    assert [(event.data["late"], event.data["lag_s"]) for event in told] == [(True, 0.3), (False, 0.0)]
