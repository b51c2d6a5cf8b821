"""Checkpoint of a simulated world: a state file in the run folder, written ten times a second.

A resumed world restores its time, the poses of the robots and of the obstacles that are not fixed, and the odometry.
Bodies start at rest, as robots do after their driver died; gateways are new and stay closed for T_grant.
"""

from __future__ import annotations

import sys
from math import cos, inf, sin
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import read_given_json
from lfa.protocol.geometry import Pose2D
from lfa.protocol.node import Envelope, Received
from lfa.protocol.output import replace_file, write_line
from lfa.world.description.scenario import STATE, Obstacle, Scenario
from lfa.world.saved_state import Memory
from lfa.world.world import World

EVERY_S = 0.1
AGAIN_S = 5.0
"""Time [s] until the next attempt after the disk refused a state."""


def read(run: Path) -> Memory:
    """Return the state last written for the run in that folder. Raises Refused if there is none."""
    path = run / STATE if run.is_dir() else run
    return read_given_json(path, Memory, "must be the state of a world, or a run folder with one", option="--resume")


def resumed(scenario: Scenario, memory: Memory) -> Scenario:
    """Return the drawn `scenario` with bodies at the poses in `memory`, and with the obstacles set down meanwhile.

    Raises Refused for another team.
    """
    robots, world = scenario.mission.robots, scenario.world
    if set(scenario.robots) != {robot.id for robot in memory.robots}:
        ids = sorted(robot.id for robot in memory.robots)
        raise Refused(f"--resume: the state is of robots {ids}, the scenario has {list(scenario.robots)}")
    at = {robot.id: (robot.pose.x, robot.pose.y, robot.pose.theta) for robot in memory.robots}
    starts = tuple(at[robot] for robot in robots)
    spares = tuple(replace(spare, start=at[spare.id]) for spare in world.spares)
    obstacles = tuple(
        obstacle if obstacle.mass_kg is None or n not in memory.things else _put(obstacle, memory.things[n])
        for n, obstacle in enumerate(world.obstacles)
    )
    world = replace(world, starts=starts, spares=spares, obstacles=(*obstacles, *memory.added))
    return replace(scenario, world=world)


def _put(obstacle: Obstacle, pose: Pose2D) -> Obstacle:
    c, s = cos(pose.theta), sin(pose.theta)
    corners = obstacle.corners_m
    turned = None if corners is None else tuple((c * x - s * y, s * x + c * y) for x, y in corners)
    return replace(obstacle, center_m=(pose.x, pose.y), corners_m=turned)


class Remembering:
    """World that writes its state to a file. Implements the Node interface."""

    def __init__(self, world: World, run: Path) -> None:
        self._world = world
        self._path = run / STATE
        self._next_at = -inf
        self._refused = False

    def receive(self, received: Received) -> list[Envelope]:
        return self._world.receive(received)

    def tick(self, now: float) -> list[Envelope]:
        sent = self._world.tick(now)
        if now >= self._next_at:
            self._next_at = now + EVERY_S
            self._keep()
        return sent

    def _keep(self) -> None:
        """Write the state; where that fails (full disk) keep the last state, and try again after AGAIN_S."""
        reason = replace_file(self._path, msgspec.json.encode(self._world.memory()))
        if reason:
            self._next_at += AGAIN_S
        if reason and not self._refused:
            write_line(f"{self._path}: {reason}: the state on disk gets old", sys.stderr)
        self._refused = bool(reason)

    def next_deadline(self) -> float:
        return self._world.next_deadline()

    @property
    def name(self) -> str:
        return self._world.name

    @property
    def incarnation(self) -> int:
        return self._world.incarnation

    @property
    def started_with(self) -> dict[str, Any]:
        return self._world.started_with

    @property
    def interests(self) -> frozenset[str]:
        return self._world.interests

    @property
    def defer_hellos(self) -> bool:
        return self._world.defer_hellos

    @property
    def defer_grants(self) -> bool:
        return self._world.defer_grants

    @property
    def finished(self) -> bool:
        return self._world.finished

    @property
    def refusal(self) -> str | None:
        return self._world.refusal
