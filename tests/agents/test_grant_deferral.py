"""What of the lease waits for the next control step: grants while it lasts well beyond that, rounds without a vote."""

from __future__ import annotations

from lfa.agents.agent import Agent
from lfa.agents.robot_core import EASE_PERIODS
from lfa.protocol.messages.consensus import Role
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.transport.link_model import Radio
from lfa.protocol.witness import Witness
from lfa.world.description.load import draw, load, shipped
from lfa.world.physics.kinematics import Kinematic
from lfa.world.simulator import Simulator
from lfa.world.world import World


def test_only_a_leader_with_time_left_is_at_ease() -> None:
    scenario = draw(shipped()["straight"], 1)
    simulator = Simulator(Radio(), 1)
    agents = {robot: Agent(robot, 1, "f", 1) for robot in scenario.mission.robots}
    world = World("f", scenario, 1, 1, start_at=0.0, bodies=Kinematic)
    for node in (world, Witness("f", 1, 1), *agents.values()):
        simulator.add(node, Journal(None, Heading(JOURNAL_VERSION, node.name, 1, 0, {})))
    simulator.run(2.0)
    assert {robot for robot, agent in agents.items() if agent.defer_grants} == {1}
    for other in ("witness", "robot2", "robot3", "robot4"):
        simulator.kill(other, hinted=False)
    leader, last_at_ease, led_until = agents[1], 0.0, 0.0
    ease_s = EASE_PERIODS * scenario.mission.control_period_s
    while simulator.now < 3.0:
        simulator.run(simulator.now + 0.001)
        if leader.lease is not None and leader.lease.role is Role.LEADER:
            led_until = simulator.now
        if leader.defer_grants:
            last_at_ease = simulator.now
    assert 2.0 < last_at_ease < led_until - 0.5 * ease_s < 2.5


def test_the_rounds_of_a_leader_wait_only_where_a_robot_follows_and_has_no_vote() -> None:
    scenario = draw(load("straight", ["world.lidar.beams=0"], 9), 1)
    simulator = Simulator(Radio(), 1)
    agents = {robot: Agent(robot, 1, "f", 1) for robot in scenario.mission.robots}
    world = World("f", scenario, 1, 1, start_at=0.0, bodies=Kinematic)
    for node in (world, Witness("f", 1, 1), *agents.values()):
        simulator.add(node, Journal(None, Heading(JOURNAL_VERSION, node.name, 1, 0, {})))
    assert not any(agent.defer_rounds for agent in agents.values())
    simulator.run(2.0)
    lease = agents[1].lease
    assert lease is not None
    assert lease.role is Role.LEADER
    voters = {voter.id for voter in lease.config.voters}
    assert {robot for robot, agent in agents.items() if agent.defer_rounds} == set(agents) - voters
    assert len(voters) == 7
    simulator.kill("robot1")
    simulator.run(4.0)
    led = agents[2].lease
    assert led is not None
    assert led.role is Role.LEADER
    voters = {voter.id for voter in led.config.voters}
    assert {robot for robot, agent in agents.items() if agent.defer_rounds} == set(agents) - voters - {1}
