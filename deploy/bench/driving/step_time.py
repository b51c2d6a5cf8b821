"""Processor time of one control step of an agent, with the scans of 180 beams, in a simulated team that explores."""

from __future__ import annotations

from time import thread_time

from lfa.agents.agent import Agent
from lfa.protocol.node import Envelope

SCENARIO, SEED, ROBOTS = "explore", 1, 4
UNTIL_S = 60.0
SHARE = 0.99


class TimedAgent(Agent):
    """Agent whose control steps are timed: those in which it commands its wheels."""

    taken_s: list[float]

    def tick(self, now: float) -> list[Envelope]:
        began = thread_time()
        sent = super().tick(now)
        took_s = thread_time() - began
        if any(envelope.key.endswith("/cmd_vel") for envelope in sent):
            self.taken_s.append(took_s)
        return sent


def step_ms(until_s: float = UNTIL_S) -> list[float]:
    """Return the p99 [ms] of the control steps of all robots until `until_s` [s]."""
    from lfa.deploy.run.simulate import SimulatedRun
    from lfa.world.description.load import draw, load

    taken_s: list[float] = []

    def make(robot_id: int, incarnation: int, fleet: str, floor: int, *, spare: bool = False) -> Agent:
        agent = TimedAgent(robot_id, incarnation, fleet, floor, spare=spare)
        agent.taken_s = taken_s
        return agent

    scenario = draw(load(SCENARIO, ("world.lidar.beams=180",), ROBOTS), SEED)
    run = SimulatedRun(scenario, SEED, (), lambda _t, _key, _message: None, None, make_agent=make)
    run.advance(until_s)
    run.close()
    return [1e3 * sorted(taken_s)[int(SHARE * len(taken_s))]]
