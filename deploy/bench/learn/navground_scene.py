"""Script for an interpreter with navground: a column of robots with two wheels that are driven straight on.

Arguments: robots, step [s], speed [m/s], spacing [m], steps. Prints the steps per second of processor time.
"""

from __future__ import annotations

import sys
from time import process_time

from navground import core, sim

RADIUS_M = 0.2


def main(words: list[str]) -> None:
    robots, steps = int(words[0]), int(words[4])
    step_s, speed_mps, spacing_m = map(float, words[1:4])
    world = sim.World()
    for n in range(robots):
        drive = core.Kinematics.make_type("2WDiff")
        drive.max_speed, drive.wheel_axis = speed_mps, 2.0 * RADIUS_M
        behavior = core.Behavior.make_type("Dummy")
        behavior.optimal_speed = speed_mps
        behavior.target = core.Target.Direction((1.0, 0.0))
        agent = sim.Agent(radius=RADIUS_M, kinematics=drive, behavior=behavior, control_period=step_s)
        agent.position = (-n * spacing_m, 0.0)
        world.add_agent(agent)
    world.update(step_s)
    began = process_time()
    for _ in range(steps):
        world.update(step_s)
    print(steps / (process_time() - began))


if __name__ == "__main__":
    main(sys.argv[1:])
