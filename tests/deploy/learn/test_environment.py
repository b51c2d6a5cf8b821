"""Environments keep the contracts of PettingZoo and Gymnasium, and end in a line, not in a riddle."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

from lfa.deploy.learn.observation import FIELDS
from lfa.deploy.learn.team_environment import TeamEnvironment
from lfa.deploy.simulate import environment, robot_environment
from lfa.protocol.errors import Refused

SHORT = ["time_limit_s=2.0"]
STILL = np.zeros(2, np.float32)


def drive(env: TeamEnvironment, actions: dict[str, Any], steps: int, seed: int = 1) -> list[dict[str, Any]]:
    """Return what is seen at the reset and after each step with the same `actions`."""
    return [env.reset(seed)[0], *(env.step(actions)[0] for _ in range(steps))]


@pytest.mark.filterwarnings("ignore")
def test_it_is_a_parallel_env() -> None:
    parallel_api_test(environment("paper_path1", set=SHORT), num_cycles=60)


@pytest.mark.filterwarnings("ignore")
def test_equal_seeds_make_equal_episodes() -> None:
    parallel_seed_test(lambda: environment("paper_path1", set=SHORT), num_cycles=15)


def test_one_robot_is_a_gymnasium_env() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        check_env(robot_environment("paper_path1", 2, set=SHORT), skip_render_check=True)


def test_whom_no_action_commands_drives_as_always_and_a_commanded_robot_obeys() -> None:
    env = environment("straight", [2, 3], set=["time_limit_s=20.0"], robots=3)
    own, held = drive(env, {}, 20)[-1], drive(env, {"robot3": STILL}, 20)[-1]
    linear = FIELDS.index("linear_x")
    assert own["robot3"][linear] > 0.3
    assert held["robot3"][linear] == 0.0
    assert held["robot2"][linear] > 0.3, "its own behaviour drives it"


def test_the_drive_limits_what_a_policy_commands() -> None:
    env = environment("straight", [3], set=["time_limit_s=20.0"], robots=3)
    assert drive(env, {"robot3": np.array([50.0, 0.0])}, 30)[-1]["robot3"][FIELDS.index("linear_x")] == pytest.approx(
        1.0
    )


def test_a_killed_robot_is_terminated_and_the_others_go_on() -> None:
    env = environment("straight", [2, 3], set=["time_limit_s=20.0"], robots=3, faults=["kill 3 at 0.35 s"])
    env.reset(1)
    ended = [env.step({})[2] for _ in range(4)]
    assert [step.get("robot3") for step in ended] == [False, False, True, None]
    assert env.agents == ["robot2"]


def test_at_the_time_limit_it_is_truncated_and_a_further_step_says_what_to_do() -> None:
    env = environment("straight", [2], set=["time_limit_s=1.0"], robots=2)
    with pytest.raises(ResetNeeded, match=r"step\(\) before reset\(\): reset\(\) begins a run"):
        env.step({})
    env.reset(1)
    while env.agents:
        _, _, terminated, truncated, told = env.step({})
    assert (terminated, truncated, told) == ({"robot2": False}, {"robot2": True}, {"robot2": {"outcome": "time_limit"}})
    with pytest.raises(ResetNeeded, match=r"after the end of the run \(time_limit\): reset\(\) begins the next one"):
        env.step({})


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ({"commanded": [9]}, r"commanded=\[9\]: must be some of robots \[1, 2, 3, 4\]"),
        ({"commanded": [2, 2]}, r"commanded=\[2, 2\]: must be some of robots \[1, 2, 3, 4\], each once"),
        ({"commanded": []}, r"commanded=\[\]: must be some of robots"),
        ({"robots": [1, 2]}, r"robots=\[1, 2\]: must be a whole number, the size of the team"),
        ({"robots": 1e9}, r"robots=1000000000.0: must be a whole number"),
        ({"robots": 2000}, r"--robots 2000: mission.robots = 2000 ids: must be at most 1000 ids"),
        ({"commanded": 2}, r"commanded=2: must be a list of robots, of \[1, 2, 3, 4\]"),
        ({"step_s": "fast"}, r"step_s='fast': must be a finite time"),
        ({"step_s": 0.0}, r"step_s=0.0: must be a finite time \[s\] above 0"),
    ],
)
def test_a_bad_argument_is_one_line(arguments: dict[str, Any], line: str) -> None:
    with pytest.raises(Refused, match=line):
        environment("straight", **arguments)


@pytest.mark.parametrize("action", [np.array([np.nan, 0.0]), [0.0, 0.0, 0.0], "fast", [[0.1], [0.1, 0.2]]])
def test_an_action_that_is_no_twist_is_one_line(action: Any) -> None:
    env = environment("straight", [2], set=SHORT, robots=2)
    env.reset(1)
    with pytest.raises(Refused, match="must be two finite numbers"):
        env.step({"robot2": action})


@pytest.mark.parametrize("actions", [{"robot9": [0.1, 0.0]}, {"robot1": [0.1, 0.0]}, [0.1, 0.0], []])
def test_actions_of_nobody_whom_the_policy_commands_are_one_line(actions: Any) -> None:
    env = environment("straight", [2], set=SHORT, robots=2)
    env.reset(1)
    with pytest.raises(Refused, match=r"must be a dict of actions by agent, of \['robot2'\]"):
        env.step(actions)


def test_a_seed_that_is_no_whole_number_is_one_line() -> None:
    with pytest.raises(Refused, match="seed='first': must be a whole number"):
        environment("straight", [2], set=SHORT, robots=2).reset("first")  # type: ignore[arg-type]
