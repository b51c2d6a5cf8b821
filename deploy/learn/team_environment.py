"""A simulated team as a PettingZoo `ParallelEnv`: its agents are the robots that a policy commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box, Space
from pettingzoo import ParallelEnv

from lfa.agents.agent import Agent
from lfa.deploy.faults.script import Fault
from lfa.deploy.learn.commanded_agent import CommandedAgent
from lfa.deploy.learn.observation import SIZE, Observation, TeamView
from lfa.deploy.run.simulate import SimulatedRun
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Twist
from lfa.protocol.names import robot_id_of, robot_name
from lfa.world.description.load import Scenario, draw

Action = npt.NDArray[np.float32]
Steps = tuple[dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]


class TeamEnvironment(ParallelEnv[str, Observation, Action]):
    """Runs of `scenario` in virtual time, in which actions are twists (m/s, rad/s) held for `step_s` [s].

    A robot that a call of `step` names no action for drives as always in that time. An episode ends when the run does:
    `terminations` at the goal, at a failure, and for a robot whose process has ended, `truncations` at the time limit.
    """

    metadata: dict[str, Any] = {"name": "lfa", "render_modes": []}  # noqa: RUF012 (PettingZoo's own type)
    render_mode = None

    def __init__(self, scenario: Scenario, commanded: Sequence[int], faults: Sequence[Fault], step_s: float) -> None:
        """Prepare the environment. Raises Refused for a robot that the mission does not have, and for `step_s` <= 0."""
        strangers = [robot for robot in commanded if robot not in scenario.mission.robots]
        if strangers or not commanded or len(set(commanded)) < len(commanded):
            right = f"must be some of robots {list(scenario.mission.robots)}, each once"
            raise Refused(f"commanded={list(commanded)}: {right}")
        if not (isinstance(step_s, int | float) and isfinite(step_s) and step_s > 0.0):
            raise Refused(f"step_s={step_s!r}: must be a finite time [s] above 0")
        limits = scenario.mission.limits
        low = np.array([-limits.v_reverse_max_mps, -limits.omega_max_radps], np.float32)
        high = np.array([limits.v_max_mps, limits.omega_max_radps], np.float32)
        self.possible_agents = [robot_name(robot) for robot in commanded]
        self.agents: list[str] = []
        self.action_spaces: dict[str, Space[Any]] = {name: Box(low, high) for name in self.possible_agents}
        self.observation_spaces: dict[str, Space[Any]] = {
            name: Box(-np.inf, np.inf, (SIZE,)) for name in self.possible_agents
        }
        self._scenario = scenario
        self._faults = faults
        self._step_s = step_s
        self._seed = scenario.seed - 1
        self._run: SimulatedRun | None = None
        self._commanded: dict[str, CommandedAgent] = {}

    def observation_space(self, agent: str) -> Space[Any]:
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Space[Any]:
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Begin a run drawn with `seed`, by default the seed after the last one, the first time the scenario's own."""
        if not (seed is None or isinstance(seed, int | np.integer)):
            raise Refused(f"seed={seed!r}: must be a whole number")
        self._seed = self._seed + 1 if seed is None else int(seed)
        self._commanded = {}
        drawn = draw(self._scenario, self._seed)
        self._view = TeamView(drawn)
        self._run = SimulatedRun(drawn, self._seed, self._faults, self._view.record, None, make_agent=self._agent)
        self._run.advance(self._step_s)
        self.agents = list(self.possible_agents)
        return {name: self._seen(name) for name in self.agents}, {name: {} for name in self.agents}

    def step(self, actions: Mapping[str, Action]) -> Steps:
        """Go on for `step_s`. Raises ResetNeeded before the first `reset` and after the end of a run, and Refused for
        actions that are none.
        """
        run = self._run
        if run is None:
            raise ResetNeeded("step() before reset(): reset() begins a run")
        if not self.agents:
            over = "no commanded robot is left" if run.verdict is None else run.verdict.outcome
            raise ResetNeeded(f"step() after the end of the run ({over}): reset() begins the next one")
        if not (isinstance(actions, Mapping) and set(actions) <= set(self.possible_agents)):
            raise Refused(f"actions {actions!r}: must be a dict of actions by agent, of {self.possible_agents}")
        for name, agent in self._commanded.items():
            action = actions.get(name)
            agent.wanted = None if action is None else _twist(action)
        run.advance(run.now + self._step_s)
        named, verdict = self.agents, run.verdict
        late = verdict is not None and verdict.outcome == "time_limit"
        ended = {name: (verdict is not None and not late) or name not in run.present for name in named}
        self.agents = [name for name in named if not ended[name] and not late]
        rewards = {name: self._view.reward(_id(name), run.leader) for name in named}
        infos = {name: {} if verdict is None else {"outcome": verdict.outcome} for name in named}
        seen = {name: self._seen(name) for name in named}
        return seen, rewards, ended, dict.fromkeys(named, late), infos

    def render(self) -> None:
        """Draw nothing: `lfa view` shows recorded runs."""

    def close(self) -> None:
        """End the run."""
        self._run, self.agents = None, []

    def _seen(self, name: str) -> Observation:
        assert self._run is not None
        return self._view.observation(_id(name), self._run.leader)

    def _agent(self, robot: int, incarnation: int, fleet: str, floor: int, *, spare: bool) -> Agent:
        if robot_name(robot) not in self.possible_agents:
            return Agent(robot, incarnation, fleet, floor, spare=spare)
        self._commanded[robot_name(robot)] = agent = CommandedAgent(robot, incarnation, fleet, floor)
        return agent


def _id(name: str) -> int:
    robot = robot_id_of(name)
    assert robot is not None, name
    return robot


def _twist(action: Action) -> Twist:
    """Return an action as a twist. Raises Refused for one that is no two finite numbers."""
    try:
        values = np.asarray(action, float)
    except (TypeError, ValueError):  # a text, or rows of several lengths
        values = np.array([])
    if values.shape != (2,) or not np.isfinite(values).all():
        raise Refused(f"action {action!r}: must be two finite numbers, forward [m/s] and yaw rate [rad/s]")
    return Twist(float(values[0]), float(values[1]))
