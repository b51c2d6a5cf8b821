"""Each row of the decision table (control.md section 7) in a small world of its own: one feature, one robot.

What is checked: the decision that the robot logs, what it says that it updates, and where the robot ended.
"""

from __future__ import annotations

from math import pi
from typing import Any

import pytest
from msgspec import Struct

from lfa.agents.agent import Agent
from lfa.agents.avoidance.decision import TABLE
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.team import Event
from lfa.protocol.node import Node
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.witness import Witness
from lfa.world.description.load import load
from lfa.world.simulator import Simulator
from lfa.world.world import World

GOAL_X = 5.0
CORRIDOR = "world.walls_m=[[-1.5,0.55,7.0,0.55],[-1.5,-0.55,7.0,-0.55]]"
BARS = "world.walls_m=[[-1.5,0.55,2.5,0.55],[2.5,0.55,2.5,-0.55],[2.5,-0.55,-1.5,-0.55]]"
HALF_HIDDEN = "world.obstacles=[{{center_m=[2.0,{}],radius_m=0.35}},{{center_m=[1.35,0.42],radius_m=0.12}}]"
"""The left end of a thing lies behind a nearer one; it comes into sight within 0.2 m where it reaches less far."""
FINE = "world.ground={reach_m=1.0,increment_m=0.02}"


class Case(Struct, frozen=True):
    kind: str
    row: str
    actions: tuple[str, ...]
    """One of these is logged with the row; empty: the way is gone on with."""
    world: tuple[str, ...]
    ends: str
    """`goal`: at rest there; `turned`: it headed back; `before`: it did not come over the feature; `backed`: behind
    its start."""


CASES = (
    Case(
        "moving",
        "it keeps its distance",
        (),
        ("world.obstacles=[{center_m=[2.5,3.0],radius_m=0.25,waypoints_m=[[5.0,3.0]],speed_mps=0.2}]",),
        "goal",
    ),
    Case(
        "moving",
        "it comes too near",
        ("slow", "wait", "back"),
        ("world.obstacles=[{center_m=[2.5,-2.0],radius_m=0.25,waypoints_m=[[2.5,9.0]],speed_mps=0.3}]",),
        "goal",
    ),
    Case("wall", "a side is free", ("left", "right"), ("world.walls_m=[[2.5,-0.5,2.5,1.2]]",), "goal"),
    Case("wall", "both sides barred", ("u_turn",), (BARS,), "turned"),
    Case("wall", "too near to turn", ("back",), ("world.walls_m=[[0.17,-0.6,0.17,0.6]]",), "backed"),
    Case(
        "ditch",
        "narrow or shallow enough",
        ("overcome",),
        ("world.ditches=[{ends_m=[[2.0,-4.0],[2.0,4.0]],width_m=0.03,depth_m=0.3}]", FINE),
        "goal",
    ),
    Case(
        "ditch",
        "a side is free",
        ("left", "right"),
        ("world.ditches=[{ends_m=[[2.0,-0.7],[2.0,0.6]],width_m=0.3,depth_m=0.3}]", FINE),
        "goal",
    ),
    Case(
        "ditch",
        "both sides barred",
        ("u_turn",),
        ("world.ditches=[{ends_m=[[2.0,-0.6],[2.0,0.6]],width_m=0.3,depth_m=0.3}]", CORRIDOR, FINE),
        "before",
    ),
    Case(
        "pothole",
        "narrow or shallow enough",
        ("overcome",),
        ("world.potholes=[{center_m=[2.0,0.0],width_m=0.03,length_m=0.2,depth_m=0.1}]", FINE),
        "goal",
    ),
    Case(
        "pothole",
        "too large, a side is free",
        ("left", "right"),
        ("world.potholes=[{center_m=[2.0,0.05],width_m=0.4,depth_m=0.2}]",),
        "goal",
    ),
    Case(
        "pothole",
        "its end is not in sight",
        ("u_turn",),
        ("world.potholes=[{center_m=[3.2,0.0],width_m=1.8,length_m=1.8,theta=0.785,depth_m=0.2}]",),
        "before",
    ),
    Case(
        "stationary",
        "a side is free",
        ("left", "right"),
        ("world.obstacles=[{center_m=[2.0,0.05],radius_m=0.25}]",),
        "goal",
    ),
    Case(
        "stationary",
        "both sides barred",
        ("u_turn",),
        ("world.obstacles=[{center_m=[2.0,0.0],radius_m=0.2}]", CORRIDOR),
        "turned",
    ),
    Case(
        "stationary",
        "its end is not in sight",
        ("creep",),
        (HALF_HIDDEN.format(0.26),),
        "goal",
    ),
    Case(
        "stationary",
        "its end stays out of sight",
        ("u_turn",),
        (HALF_HIDDEN.format(0.3),),
        "before",
    ),
    Case(
        "bump",
        "low enough",
        ("climb",),
        ("world.bumps=[{center_m=[2.0,0.0],width_m=0.3,length_m=2.0,height_m=0.008}]", FINE),
        "goal",
    ),
    Case(
        "bump",
        "too high, a side is free",
        ("left", "right"),
        ("world.bumps=[{center_m=[2.0,0.05],width_m=0.3,length_m=0.6,height_m=0.03}]", FINE),
        "goal",
    ),
    Case(
        "bump",
        "too high, both sides barred",
        ("u_turn",),
        ("world.bumps=[{center_m=[2.0,0.0],width_m=0.3,length_m=1.08,height_m=0.03}]", CORRIDOR, FINE),
        "before",
    ),
)


def action_of(decision: dict[str, Any]) -> object:
    return decision["action"]


def driven(case: Case, seconds: float) -> tuple[list[dict[str, Any]], list[Pose2D]]:
    """One robot on a straight way of 5 m: its decisions, and where it truly was until it planned a way round."""
    route = f"mission.leading.route_m=[[0.0,0.0],[{GOAL_X},0.0]]"
    scenario = load("straight", ["mission.robots=[1]", route, "mission.leading.cruise_mps=0.4", *case.world])
    simulator = Simulator(scenario.radio, seed=1)
    decisions: list[dict[str, Any]] = []
    poses: list[Pose2D] = []

    def hear(_now: float, _key: str, _payload: bytes, message: Message) -> None:
        if isinstance(message, Event) and message.kind == "decision":
            decisions.append(message.data)
        elif isinstance(message, Truth) and (case.ends == "goal" or "plan_round" not in map(action_of, decisions)):
            poses.append(Pose2D(message.robots[0].x, message.robots[0].y, message.robots[0].theta))

    simulator.taps.append(hear)
    nodes: list[Node] = [World("table", scenario, 1, 1, start_at=0.0), Witness("table", 1, 1), Agent(1, 1, "table", 1)]
    for node in nodes:
        simulator.add(node, Journal(None, Heading(JOURNAL_VERSION, node.name, 1, 1, {})))
    simulator.run(seconds)
    return decisions, poses


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.kind}: {case.row}")
def test_a_row_of_the_table_is_done(case: Case) -> None:
    decisions, poses = driven(case, 30.0 if case.ends == "goal" else 14.0)
    told = [d for d in decisions if d["class"] == case.kind and d["action"] != "resume"]
    if case.actions:
        of_row = [d for d in told if d.get("condition") == case.row]
        assert of_row, f"told: {told}"
        assert of_row[0]["action"] in case.actions
        [row] = [row for row in TABLE if (row.kind, row.name) == (case.kind, case.row)]
        assert of_row[0]["updates"] == row.updates
    else:
        assert told == []
    last = poses[-1]
    match case.ends:
        case "goal":
            assert abs(last.x - GOAL_X) < 0.15 and abs(last.y) < 0.15, last
        case "turned":
            assert max(abs(pose.theta) for pose in poses) > 0.75 * pi
        case "before":
            assert max(pose.x for pose in poses) < 2.0 - 0.15
        case "backed":
            assert min(pose.x for pose in poses) < -0.02


def test_every_row_is_driven() -> None:
    assert {(row.kind, row.name) for row in TABLE} == {(case.kind, case.row) for case in CASES}
