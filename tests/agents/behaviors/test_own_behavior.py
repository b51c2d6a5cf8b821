"""Behaviours of one's own: found by name, asked in order, and a fault of one is a line of text."""

from __future__ import annotations

from importlib.metadata import EntryPoint, EntryPoints
from math import nan
from typing import Any

import pytest
from msgspec.structs import replace

from lfa.agents.behaviors.own_behavior import BEHAVIORS, BehaviorInput, OwnBehaviors, add_behavior
from lfa.deploy.run.simulate import measure
from lfa.deploy.scenario_loading import load_scenario
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.messages.consensus import Role
from lfa.protocol.mission import Mission

SEEN = BehaviorInput(1.0, Role.LEADER, Pose2D(0.0, 0.0, 0.0), STILL, Twist(0.4, 0.0), (), ())


class Answer:
    """Give the same answer in each step."""

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def step(self, seen: BehaviorInput) -> Any:
        return self.answer


class Half:
    """Drive at half the wanted speed."""

    def __init__(self, mission: Mission) -> None: ...

    def step(self, seen: BehaviorInput) -> Twist:
        return Twist(0.5 * seen.wanted.linear_x, seen.wanted.angular_z)


class Broken(Half):
    def step(self, seen: BehaviorInput) -> Twist:
        raise ValueError("no idea")


@pytest.fixture(autouse=True)
def _nothing_added(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BEHAVIORS, "_added", {})


def named(*names: str) -> OwnBehaviors:
    return OwnBehaviors(replace(Mission(), behaviors=names))


def test_without_behaviours_the_role_has_its_way() -> None:
    assert named().step(SEEN) == SEEN.wanted


def test_each_behaviour_gets_what_the_one_before_wants() -> None:
    add_behavior("half", Half)
    assert named("half", "half").step(SEEN) == Twist(0.1, 0.0)


def test_an_answer_of_none_leaves_the_twist_as_it_is() -> None:
    add_behavior("none", lambda mission: Answer(None))
    assert named("none").step(SEEN) == SEEN.wanted


def test_an_installed_behaviour_is_found_by_its_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("half", f"{__name__}:Half", "lfa.behaviors")
    monkeypatch.setattr(EntryPoint, "load", lambda self: Half)
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: EntryPoints([point]))
    assert named("half").step(SEEN) == Twist(0.2, 0.0)


@pytest.mark.parametrize("answer", [Twist(nan, 0.0), 1.0, "left"])
def test_an_answer_that_is_no_finite_twist_brings_the_robot_to_rest_and_is_told(answer: Any) -> None:
    add_behavior("odd", lambda mission: Answer(answer))
    behaviors = named("odd")
    assert behaviors.step(SEEN) == STILL
    assert behaviors.failure is not None and "must be a Twist of finite numbers or None" in behaviors.failure


def test_a_behaviour_that_raises_ends_the_run_with_its_file_and_line_as_reason() -> None:
    add_behavior("broken", Broken)
    summary = measure(load_scenario("straight", ["mission.behaviors=['broken']"], 1), 1).summary
    assert summary.outcome == "failed"
    assert "behavior broken: test_own_behavior.py:" in str(summary.reason) and "no idea" in str(summary.reason)


def test_an_unknown_behaviour_is_refused_with_the_key_that_names_it() -> None:
    with pytest.raises(Refused, match=r"mission\.behaviors: no behavior 'nobody'"):
        load_scenario("straight", ["mission.behaviors=['nobody']"])


def test_a_class_without_a_step_is_refused() -> None:
    add_behavior("idle", lambda mission: object())  # type: ignore[arg-type, return-value]
    with pytest.raises(Refused, match="must be a class with the method step"):
        named("idle")
