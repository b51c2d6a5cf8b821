"""One robot of a simulated team as a Gymnasium `Env`; all others drive as always."""

from __future__ import annotations

from typing import Any

import gymnasium
from gymnasium.spaces import Space

from lfa.deploy.learn.observation import Observation
from lfa.deploy.learn.team_environment import Action, TeamEnvironment


class RobotEnvironment(gymnasium.Env[Observation, Action]):
    """The one agent of a `TeamEnvironment`."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (Gymnasium's own type)

    def __init__(self, team: TeamEnvironment) -> None:
        (self._name,) = team.possible_agents
        self._team = team
        self.observation_space: Space[Any] = team.observation_space(self._name)
        self.action_space: Space[Any] = team.action_space(self._name)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a run, as `TeamEnvironment.reset` does."""
        super().reset(seed=seed)
        seen, infos = self._team.reset(seed, options)
        return seen[self._name], infos[self._name]

    def step(self, action: Action) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Go on for one step, as `TeamEnvironment.step` does."""
        seen, rewards, ended, late, infos = self._team.step({self._name: action})
        name = self._name
        return seen[name], rewards[name], ended[name], late[name], infos[name]

    def close(self) -> None:
        self._team.close()
