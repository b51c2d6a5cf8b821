"""A run folder in numbers: ground truth, errors and events, read once and kept."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from deploy.look import chronicle, errors, trace
from deploy.look import summary as summaries
from deploy.look.chronicle import Line
from deploy.look.errors import Errors, Mask
from deploy.look.trace import Array, Trace
from deploy.run.folder import scenario_of
from world.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Run:
    """`truth`: by robot, in `map`, rows of t [s], x, y [m], theta [rad], v [m/s], omega [rad/s].
    `errors`: by follower (deploy/look/errors.py). `events`: the lines of events.jsonl."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.scenario: Scenario = scenario_of(folder)
        self.seen: Trace = trace.read(folder)
        self.events: list[Line] = chronicle.lines(folder)

    @cached_property
    def summary(self) -> summaries.Summary:
        return summaries.read(self.folder)

    @property
    def truth(self) -> dict[int, Array]:
        return self.seen.truth

    def figure(self, name: str) -> Figure:
        """One of FIGURES by its name. Raises KeyError with the names that there are."""
        from deploy.look import figures

        if name not in (known := [known for known, *_ in figures.FIGURES]):
            raise KeyError(f"{name}: must be one of {', '.join(known)}")
        return figures.drawn(name, self)

    @property
    def robots(self) -> tuple[int, ...]:
        return self.scenario.mission.robots

    @cached_property
    def errors(self) -> dict[int, Errors]:
        """Of every robot that ever followed."""
        found = {robot: errors.of_follower(self.seen, robot) for robot in self.robots}
        return {robot: of for robot, of in found.items() if of is not None}

    @cached_property
    def reigns(self) -> list[chronicle.Reign]:
        return chronicle.reigns(self.events)

    def led(self, robot: int, t: Array) -> Mask:
        """Which of the moments `t` [s] fall into a reign of `robot`."""
        led = np.zeros(t.size, dtype=bool)
        for reign in self.reigns:
            if reign.robot_id == robot:
                led |= (t >= reign.from_s) & (t < (np.inf if reign.until_s is None else reign.until_s))
        return led
