"""Panels over time: one line for each robot, marks for faults and requests, and a strip of avoidances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lfa.deploy.analysis import episodes
from lfa.deploy.analysis.run_data import Run
from lfa.deploy.recording import event_log
from lfa.deploy.recording.mcap_reader import Array
from lfa.deploy.view.figures.style import CLEAR, LEGEND_MAX, label, look

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS_MAX = 8000  # sum over all lines of one panel
STRIP = "#555555"
TOGETHER_SHARE = 0.02
"""Share of a run's duration within which marks share one text: nearer ones would be printed over each other."""


def plot(axes: Axes, run: Run, of_robots: dict[int, tuple[Array, Array]]) -> None:
    """Plot one line for each robot's (t [s], y)."""
    most = POINTS_MAX // max(1, len(of_robots))
    for robot, (t, y) in of_robots.items():
        axes.plot(*_unwrapped(*thin(t, y, most)), label=label(run, robot), linewidth=1.4, **look(run, robot))


def finish(axes: Axes, run: Run, title: str, y_label: str, *, last: bool = True, legend: bool = True) -> None:
    """Add title, units, marks for faults, role switches and orientation requests, and a legend of labelled lines."""
    for at_s, text, style in marks(run):
        axes.axvline(at_s, color="black", linewidth=0.8, linestyle=style)
        if legend:
            axes.annotate(text, (at_s, 1.0), xycoords=("data", "axes fraction"), xytext=(3, -9),
                          textcoords="offset points", fontsize="small", rotation=90, va="top",
                          bbox=CLEAR)  # fmt: skip
    axes.set(title=title, ylabel=y_label, xlim=(0.0, max(run.seen.end_s, 1.0)))
    if last:
        axes.set_xlabel("time [s]")
    if legend and axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper right", ncols=len(axes.lines) if len(axes.lines) < 5 else 2, framealpha=0.9)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.12 * (high - low))


def strip(axes: Axes, run: Run) -> None:
    """Draw a bar for each avoidance of each robot, from its event log, in the robot's colour."""
    shown = [robot for robot in run.robots if label(run, robot)][:LEGEND_MAX]
    for place, robot in enumerate(shown):
        spans = [(a, max(b - a, 0.1)) for a, b in episodes.avoidances(run, robot)]
        axes.broken_barh(
            spans, (place - 0.35, 0.7), facecolors=look(run, robot)["color"], edgecolor=STRIP, linewidth=0.4
        )
    axes.set(ylim=(len(shown) - 0.4, -0.6), xlim=(0.0, max(run.seen.end_s, 1.0)), xlabel="time [s]")
    axes.set_yticks(range(len(shown)), [f"robot {robot}" for robot in shown], fontsize="small")
    axes.set_title("avoiding", fontsize="small", loc="left", pad=2.0)
    axes.grid(visible=False, axis="y")
    for at_s, _, style in marks(run):
        axes.axvline(at_s, color="black", linewidth=0.8, linestyle=style)


def thin(t: Array, y: Array, most: int) -> tuple[Array, Array]:
    """Thin a line to about `most` points: the minimum and maximum of each interval, in time order."""
    width = -(-2 * t.size // max(most, 2))
    if width <= 2:
        return t, y
    whole = t.size // width * width
    stretches = np.where(np.isnan(y[:whole]), 0.0, y[:whole]).reshape(-1, width)
    ends = np.stack([stretches.argmin(axis=1), stretches.argmax(axis=1)], axis=1)
    ends.sort(axis=1)
    kept = (ends + np.arange(0, whole, width)[:, None]).ravel()
    kept = np.append(kept, np.arange(whole, t.size))
    return t[kept], y[kept]


def _unwrapped(t: Array, y: Array) -> tuple[Array, Array]:
    """Insert a gap where an angle [deg] wraps between -180 and 180."""
    over = np.flatnonzero(np.abs(np.diff(y)) > 270.0) + 1
    return np.insert(t, over, t[over]), np.insert(y, over, np.nan)


def marks(run: Run) -> list[tuple[float, str, str]]:
    """Return time [s], text and line style of each mark, in time; what happens together shares one text."""
    found = [(fault.at_s, f"{fault.kind} {fault.target}", ":") for fault in event_log.faults(run.events)]
    found += [(led.from_s, f"robot {led.robot_id} leads", "-") for led in run.leader_terms[1:]]
    asked = (line for line in event_log.of_kind(run.events, "formation") if event_log.asked_by_leader(line))
    found += [(float(line["t"]), f"to {line.get('side', '')}", "--") for line in asked]
    together: list[tuple[float, str, str]] = []
    for at_s, text, style in sorted(found):
        if together and at_s - together[-1][0] < TOGETHER_SHARE * max(run.seen.end_s, 1.0):
            together[-1] = (together[-1][0], f"{together[-1][1]}, {text}", together[-1][2])
        else:
            together.append((at_s, text, style))
    return together
