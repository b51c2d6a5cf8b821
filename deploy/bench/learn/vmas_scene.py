"""Script for an interpreter with VMAS: a column of discs that are driven straight on, in so many copies at once.

Arguments: robots, step [s], speed [m/s], spacing [m], steps, copies. Prints the steps of one copy per second of
processor time.
"""

from __future__ import annotations

import sys
from time import process_time
from typing import Any

import torch
from vmas import make_env
from vmas.simulator.core import Agent, Sphere, World
from vmas.simulator.dynamics.diff_drive import DiffDrive
from vmas.simulator.scenario import BaseScenario

RADIUS_M = 0.2


class DiscColumn(BaseScenario):  # type: ignore[misc]  # VMAS has no types
    """Column of `robots` discs that turn and drive as robots with two wheels do."""

    def make_world(self, batch_dim: int, device: Any, **kwargs: Any) -> Any:
        world = World(batch_dim, device, dt=kwargs["step_s"])
        for n in range(kwargs["robots"]):
            drive = DiffDrive(world)
            world.add_agent(Agent(name=f"robot{n}", shape=Sphere(RADIUS_M), dynamics=drive, u_multiplier=[1.0, 1.0]))
        self._spacing_m = kwargs["spacing_m"]
        return world

    def reset_world_at(self, env_index: int | None = None) -> None:
        for n, agent in enumerate(self.world.agents):
            agent.set_pos(torch.tensor([-n * self._spacing_m, 0.0]), batch_index=env_index)

    def observation(self, agent: Any) -> Any:
        return torch.cat([agent.state.pos, agent.state.vel, agent.state.rot], dim=-1)

    def reward(self, agent: Any) -> Any:
        return agent.state.pos[:, 0]


def main(words: list[str]) -> None:
    robots, steps, copies = int(words[0]), int(words[4]), int(words[5])
    step_s, speed_mps, spacing_m = map(float, words[1:4])
    torch.set_num_threads(1)
    scene = {"robots": robots, "step_s": step_s, "spacing_m": spacing_m}
    environment = make_env(scenario=DiscColumn(), num_envs=copies, device="cpu", continuous_actions=True, **scene)
    environment.reset()
    actions = [torch.tensor([speed_mps, 0.0]).repeat(copies, 1) for _ in range(robots)]
    environment.step(actions)
    began = process_time()
    for _ in range(steps):
        environment.step(actions)
    print(copies * steps / (process_time() - began))


if __name__ == "__main__":
    main(sys.argv[1:])
