"""Table of the processes of a run: command line and restart arguments of each."""

from __future__ import annotations

from pathlib import Path

from lfa.deploy.own_code import chosen_files, files_of_robots, options_of
from lfa.deploy.process.process_group import ROUTER_NAME, ProcessSpec
from lfa.deploy.recording.run_folder import JOURNALS, SCENARIO, About
from lfa.protocol.mission import Mission
from lfa.protocol.names import robot_name
from lfa.protocol.topics import RECORDER_NAME, WORLD_NAME
from lfa.world.description.scenario import Scenario

ROBOTS_TAKE = ("controller", "behavior")
"""Plug-ins that a robot's process loads."""


def rows(folder: Path, about: About, endpoint: str, scenario: Scenario, recorder_task: str) -> list[ProcessSpec]:
    """Return the processes of a run in the order in which they are started."""
    mission = scenario.mission
    own_code = chosen_files(scenario)
    robots = options_of(own_code, ROBOTS_TAKE)
    team = ("--fleet", about.fleet, "--connect", endpoint, "--journal", str(folder / JOURNALS), "--faults")
    world = ("lfa.world.cli", str(folder / SCENARIO), "--seed", str(about.seed), "--state", str(folder), *team,
             *options_of(own_code, ("sensor",)))  # fmt: skip
    return [
        ProcessSpec(ROUTER_NAME, ("lfa.deploy.fleet.host.router", "--listen", endpoint)),
        ProcessSpec(RECORDER_NAME, ("lfa.deploy.run.recorder_process", recorder_task), outlives_launcher=True),
        ProcessSpec(WORLD_NAME, world, restart_args=("--resume", str(folder))),
        *(ProcessSpec(robot_name(i), ("lfa.agents.cli", "--role", _role(i, mission), "--id", str(i), *team,
                                          *robots, *(() if i in mission.robots else ("--spare",))))
          for i in scenario.robots),
    ]  # fmt: skip


def granted_row(
    robot_id: int, incarnation: int, endpoint: str, fleet: str, mission: Mission, *, spare: bool
) -> ProcessSpec:
    """Return the agent's process of a robot in a lockstep run, which grants it time and messages at `endpoint`."""
    arguments = ["--role", _role(robot_id, mission), "--id", str(robot_id), "--fleet", fleet, "--connect", endpoint]
    arguments += ["--lockstep", str(incarnation), *options_of(files_of_robots(mission), ROBOTS_TAKE)]
    return ProcessSpec(robot_name(robot_id), ("lfa.agents.cli", *arguments, *(("--spare",) if spare else ())))


def _role(robot_id: int, mission: Mission) -> str:
    return "leader" if robot_id == mission.robots[0] else "follower"
