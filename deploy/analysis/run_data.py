"""Data of one run folder: ground truth, tracking errors and events, read once and cached."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np

from lfa.deploy.analysis import tracking_errors
from lfa.deploy.analysis.summary import Summary, read
from lfa.deploy.analysis.tracking_errors import Mask, TrackingErrors
from lfa.deploy.recording import event_log, mcap_reader
from lfa.deploy.recording.event_log import Line
from lfa.deploy.recording.mcap_reader import Array, RecordedRun
from lfa.deploy.recording.run_folder import scenario_of
from lfa.protocol.names import robot_id_of
from lfa.world.description.load import Scenario


class Run:
    """Data of one recorded run.

    `truth`: by robot, rows of t [s], x, y [m], theta [rad], v [m/s], omega [rad/s] in `map`. `errors`: by follower
    (deploy/analysis/tracking_errors.py). `events`: the lines of events.jsonl.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.scenario: Scenario = scenario_of(folder)
        self.seen: RecordedRun = mcap_reader.read(folder)
        self.events: list[Line] = event_log.lines(folder)

    @cached_property
    def summary(self) -> Summary:
        return read(self.folder)

    @property
    def truth(self) -> dict[int, Array]:
        return self.seen.truth

    @property
    def robots(self) -> tuple[int, ...]:
        """Ids of all robots in the world, in the mission's order, the spares last."""
        return self.scenario.robots

    @cached_property
    def errors(self) -> dict[int, TrackingErrors]:
        """Tracking errors of every robot that ever followed, by its id."""
        found = {robot: tracking_errors.of_follower(self.seen, robot) for robot in self.robots}
        return {robot: of for robot, of in found.items() if of is not None}

    @cached_property
    def readings(self) -> dict[int, dict[str, list[tuple[float, dict[str, float]]]]]:
        """Readings of the sensors of a user's own: by robot and sensor, time [s] and values of each."""
        found: dict[int, dict[str, list[tuple[float, dict[str, float]]]]] = {}
        for owner, _, t, message in mcap_reader.messages(self.folder, frozenset({"reading"})):
            robot = robot_id_of(owner)
            if robot is not None:
                found.setdefault(robot, {}).setdefault(message.sensor, []).append((t, message.values))
        return found

    @cached_property
    def leader_terms(self) -> list[event_log.LeaderTerm]:
        return event_log.leader_terms(self.events)

    def led(self, robot: int, t: Array) -> Mask:
        """Return a mask of the times `t` [s] at which `robot` was the leader."""
        led = np.zeros(t.size, dtype=bool)
        for term in self.leader_terms:
            if term.robot_id == robot:
                led |= (t >= term.from_s) & (t < (np.inf if term.until_s is None else term.until_s))
        return led
