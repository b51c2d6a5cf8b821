"""A mission's control rate is that of the robots' steps, of their odometry, and of the deadman's three periods."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

from lfa.agents.agent import Agent
from lfa.agents.navigator import Navigator
from lfa.agents.team_state import TeamState, sensors_s_max
from lfa.deploy.faults.script import parse_all
from lfa.deploy.run.simulate import run
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.lease.timing import timing_for
from lfa.protocol.messages.consensus import NO_TERM, GatewayStamp
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import Localization, Sensors
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.transport.link_model import Radio
from lfa.protocol.witness import Witness
from lfa.world.description.load import draw, load
from lfa.world.physics.kinematics import Kinematic
from lfa.world.simulator import Simulator
from lfa.world.world import World


@pytest.mark.parametrize("control_hz", [10.0, 20.0, 25.0, 50.0])
def test_poses_commands_and_odometry_come_at_the_missions_rate(control_hz: float) -> None:
    scenario = draw(load("straight", (f"mission.control_hz={control_hz:g}",)), 1)
    count: Counter[str] = Counter()
    simulator = Simulator(Radio(), 1)
    simulator.taps.append(lambda _at, key, *_: count.update([key.split("/", 2)[2]]))
    world = World("f", scenario, 1, 1, start_at=0.0, bodies=Kinematic)
    for node in (world, Witness("f", 1, 1), *(Agent(robot, 1, "f", 1) for robot in scenario.mission.robots)):
        simulator.add(node, Journal(None, Heading(JOURNAL_VERSION, node.name, 1, 0, {})))
    simulator.run(2.0)
    count.clear()
    simulator.run(6.0)
    for topic in ("robot1/cmd_vel", "robot3/pose", "robot3/sensors"):
        assert count[topic] == pytest.approx(4.0 * control_hz, abs=1), topic


@pytest.mark.parametrize(("control_hz", "deadman_s"), [(50.0, 0.06), (20.0, 0.15), (10.0, 0.3)])
def test_e2_the_deadman_is_at_least_three_control_periods_and_the_bond_outlives_it(
    control_hz: float, deadman_s: float
) -> None:
    timing = timing_for(Mission(control_hz=control_hz))
    assert timing.deadman_s == pytest.approx(deadman_s)
    assert timing.grant_s > timing.act_s + timing.deadman_s


@pytest.mark.parametrize("control_hz", [10.0, 20.0, 50.0])
def test_odometry_is_lost_after_three_control_periods_and_not_before(control_hz: float) -> None:
    mission = Mission(control_hz=control_hz, leading=Leading(route_m=((4.0, 0.0),)))
    bound_s = sensors_s_max(mission)
    assert bound_s == pytest.approx({10.0: 0.3}.get(control_hz, 0.2))
    navigator = Navigator(1, mission, TeamState(bound_s))
    header = Header("driver1", 1, 1, 5.0)
    navigator.estimator.sensors(Sensors(header, Pose2D(), Twist(), 0.0, GatewayStamp(1, 5.0), NO_TERM), 5.0)
    navigator.estimator.localization(Localization(header, Pose2D()), 5.0)
    assert navigator.estimator.missing(5.0 + 0.99 * bound_s) is None
    assert navigator.estimator.missing(5.0 + 1.01 * bound_s) == "odometry"


@pytest.mark.parametrize(("control_hz", "beams"), [(20, 180), (10, 180), (10, 0)])
def test_a_team_with_few_control_steps_outlives_its_leader_and_reaches_the_goal(
    tmp_path: Path, control_hz: int, beams: int
) -> None:
    settings = (f"mission.control_hz={control_hz}", f"world.lidar.beams={beams}")
    scenario = load("straight", ("mission.leading.route_m=[[4.0, 0.0]]", "faults=['kill leader at 3 s']", *settings))
    faults = parse_all(scenario.mission, scenario.faults, ())
    summary = run(scenario, 1, tmp_path / "run", faults).summary
    assert summary.exit_code == 0, (
        f"lfa sim straight --set {settings[0]} --set {settings[1]} --fault 'kill leader at 3 s'"
    )
    assert [reign.robot_id for reign in summary.leaders] == [1, 2]
    assert all(before.term < after.term for before, after in pairwise(summary.leaders))
