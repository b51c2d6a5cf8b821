"""Timeline of a run's lease: holders, terms, causes of changes, and the chain of followers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isnan
from typing import TYPE_CHECKING

from matplotlib.figure import FigureBase

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.client.term_count import TermCount
from lfa.deploy.recording import event_log
from lfa.deploy.view.figures.style import CLEAR, LEGEND_MAX, levels, look

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LETTERS_WIDE = 150
"""Width of a figure in letters of a label."""
LINES = 3
"""Maximum number of lines of labels above a row."""
LINE = 0.36
"""Height of one line of labels, in units of the row distance."""


def draw(figure: FigureBase, run: Run) -> None:
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 3))
    end_s = max(run.seen.end_s, 1.0)
    _holders(above, run, end_s)
    _chain(below, run, end_s)
    below.set(xlim=(0.0, end_s), xlabel="time [s]")
    for axes in (above, below):
        axes.grid(visible=False)
        for fault in event_log.faults(run.events):
            axes.axvline(fault.at_s, color="black", linewidth=0.8, linestyle=":", zorder=3)


def _holders(axes: Axes, run: Run, end_s: float) -> None:
    """Draw a bar for each term; above it the cause of its start, and the faults."""
    terms = TermCount(led.term[0] for led in run.leader_terms)
    for led in run.leader_terms:
        until_s = end_s if led.until_s is None else led.until_s
        _cell(axes, 0.0, led.from_s, until_s, run, led.robot_id, end_s)
    began = [(led.from_s, f"{_said(led.cause)}, term {terms.number(led.term[0])}") for led in run.leader_terms]
    _labels(axes, began, 0.55, end_s)
    done = [(fault.at_s, f"{fault.kind} {fault.target}") for fault in event_log.faults(run.events)]
    top = 0.65 + LINE * LINES
    _labels(axes, done, top, end_s, weight="bold")
    axes.set(ylim=(-0.5, top + LINE * LINES), yticks=[0.0, 0.65 + LINE * LINES / 2.5, top + LINE * LINES / 2.5])
    axes.set_yticklabels(["lease", "began by", "faults"])
    axes.set_title("Who held the lease, and what ended the one before")
    axes.tick_params(left=False)


def _chain(axes: Axes, run: Run, end_s: float) -> None:
    """Draw a row for each place in the chain, with the robots that held it."""
    for robot, steps in event_log.places(run.events, run.robots, end_s).items():
        for from_s, until_s, place in _stretches(steps):
            _cell(axes, place, from_s, until_s, run, robot, end_s)
    last = len(run.robots) - 1
    axes.set(
        ylim=(last + 0.5, -0.5), ylabel="place in the chain", title="The chain after it, by the numbers of the robots"
    )
    axes.set_yticks(range(0, last + 1, max(1, -(-last // LEGEND_MAX))))
    axes.tick_params(left=False)


def _cell(axes: Axes, row: float, from_s: float, until_s: float, run: Run, robot: int, end_s: float) -> None:
    """Draw a robot's interval in a row, with its id if there is room."""
    axes.barh(row, until_s - from_s, left=from_s, height=0.84, color=look(run, robot)["color"], edgecolor="white")
    text = f"{robot}"
    if until_s - from_s > end_s * (len(text) + 1) / LETTERS_WIDE and len(run.robots) <= LEGEND_MAX:
        middle = (from_s + until_s) / 2.0
        axes.annotate(text, (middle, row), ha="center", va="center", color="white", fontsize=9, weight="bold")


def _labels(
    axes: Axes, texts: Sequence[tuple[float, str]], lowest: float, end_s: float, weight: str = "normal"
) -> None:
    for (at_s, text), level in zip(texts, levels(texts, end_s / LETTERS_WIDE, LINES), strict=True):
        axes.annotate(text, (at_s, lowest + LINE * level), xytext=(2, 0), textcoords="offset points", fontsize="small",
                      weight=weight, zorder=4, bbox=CLEAR)  # fmt: skip


def _stretches(steps: Sequence[tuple[float, float]]) -> Iterator[tuple[float, float, float]]:
    """Yield start [s], end [s] and place of each interval in which a robot kept one place in the chain."""
    began, kept = 0.0, float("nan")
    for at_s, place in steps:
        if place == kept or (isnan(place) and isnan(kept)):
            continue
        if not isnan(kept):
            yield began, at_s, kept
        began, kept = at_s, place
    if steps and not isnan(kept):
        yield began, steps[-1][0], kept


def _said(cause: str) -> str:
    return {"start": "start", "handed_over": "handed over", "handover": "handed over"}.get(cause, cause)
