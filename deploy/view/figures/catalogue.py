"""Table of the figures of a run, for PNGs and reports: those of the paper (7, 8, 9, 11) and others.

Lines are thinned to the resolution of a page, with every spike kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure, FigureBase

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.client.term_count import TermCount
from lfa.deploy.recording import event_log
from lfa.deploy.view.figures import timeline
from lfa.deploy.view.figures.paper_figures import distance_error, orientation_error, tracking
from lfa.deploy.view.figures.path_plot import path_flow
from lfa.deploy.view.figures.style import CLEAR, COLOURS, LEGEND_MAX, label, look
from lfa.deploy.view.figures.time_panels import finish

TERM_SHARE_MIN = 0.15  # share of the run's duration: a shorter bar has no room for its term
FONT: dict[Any, Any] = {"font.size": 9.0, "axes.titlesize": 10.0, "axes.grid": True, "grid.alpha": 0.3,
        "legend.fontsize": 8.0, "axes.axisbelow": True, "axes.spines.top": False, "axes.spines.right": False,
        "svg.hashsalt": "lfa"}  # fmt: skip
COLUMN_INCH = 3.4
"""Width of a column of a two-column paper."""
COLUMN_FONT: dict[Any, Any] = {"font.size": 6.0, "axes.titlesize": 6.5, "legend.fontsize": 5.0, "lines.linewidth": 0.8}
Draw = Callable[[FigureBase, Run], None]


def png(figure: Figure) -> bytes:
    return _saved(figure, "png", dpi=120)


def saved_as(figure: Figure, kind: str) -> bytes:
    """Return a figure as a file of `kind`: png, svg or pdf."""
    return png(figure) if kind == "png" else svg(figure) if kind == "svg" else pdf(figure)


def pdf(figure: Figure) -> bytes:
    return _saved(figure, "pdf", metadata={"CreationDate": None})


def svg(figure: Figure) -> bytes:
    return _saved(figure, "svg", metadata={"Date": None})


def drawn(name: str, run: Run, *, column: bool = False) -> Figure:
    """Draw and return the figure called `name` in FIGURES, with `column` at the width of a column of a paper."""
    (width, height), draw = next((size, draw) for known, size, _, draw in FIGURES if known == name)
    with _style(), matplotlib.rc_context(COLUMN_FONT if column else {}):
        size = (COLUMN_INCH, COLUMN_INCH * min(1.2, 1.3 * height / width)) if column else (width, height)
        figure = Figure(figsize=size, layout="constrained")
        draw(figure, run)
    return figure


def overview(run: Run) -> Figure:
    """Draw world, leaders and errors on one sheet, in the layout of the rerun viewer."""
    with _style():
        figure = Figure(figsize=(16.0, 10.0), layout="constrained")
        grid = figure.add_gridspec(20, 5)
        parts = ((grid[:15, :3], path_flow), (grid[15:, :3], _leader_timeline),
                 (grid[:8, 3:], distance_error), (grid[8:, 3:], orientation_error))  # fmt: skip
        for place, draw in parts:
            draw(figure.add_subfigure(place), run)
    return figure


def _leader_timeline(figure: FigureBase, run: Run) -> None:
    axes, end_s = figure.subplots(), max(run.seen.end_s, 1.0)
    terms = TermCount(led.term[0] for led in run.leader_terms)
    for led in run.leader_terms:
        lasted_s = (end_s if led.until_s is None else led.until_s) - led.from_s
        colour = look(run, led.robot_id)["color"]
        axes.barh(led.robot_id, lasted_s, left=led.from_s, height=0.6, color=colour, edgecolor="white")
        if lasted_s > TERM_SHARE_MIN * end_s:
            term = f"term {terms.number(led.term[0])}"
            axes.annotate(term, (led.from_s, led.robot_id), xytext=(4, 0), va="center",
                          textcoords="offset points", color="white")  # fmt: skip
    for failover in event_log.failovers(run.events, run.leader_terms):
        if failover.leader is not None and failover.first_command_ms is not None:
            axes.annotate(f"first command after {failover.first_command_ms:.0f} ms", (failover.at_s, failover.leader),
                          xytext=(4, 14), textcoords="offset points", fontsize="small", bbox=CLEAR)  # fmt: skip
    finish(axes, run, "Who led", "robot")
    shown = [robot for robot in run.robots if len(run.robots) <= LEGEND_MAX or label(run, robot)]
    axes.set_yticks(shown)
    axes.set(xlim=(0.0, end_s), ylim=(max(run.robots) + 0.8, min(run.robots) - 0.8))


def _string_stability(figure: FigureBase, run: Run) -> None:
    """Draw, per hop of the last chain, distance error and ratio of the yaw rates' std, follower to predecessor."""
    left, right = figure.subplots(1, 2)
    hops = [(robot, int(e.predecessor[-1]), e) for robot, e in run.errors.items() if e.steady.any()]
    places = np.arange(len(hops))
    names = [f"{ahead}\u2192{robot}" for robot, ahead, _ in hops]
    rms = [1000.0 * float(np.sqrt(np.mean(e.distance[e.steady] ** 2))) for *_, e in hops]
    peak = [1000.0 * float(np.max(np.abs(e.distance[e.steady]))) for *_, e in hops]
    left.bar(places - 0.2, rms, 0.4, color=COLOURS[0], label="rms")
    left.bar(places + 0.2, peak, 0.4, color=COLOURS[4], hatch="//", label="largest")
    left.set(title="Distance error of each hop, settled, detours left out", ylabel="|D - k| [mm]")
    lively = {robot: float(np.degrees(np.std(rows[:, 5]))) for robot, rows in run.seen.truth.items()}
    ratios = [lively[robot] / lively[ahead] if lively[ahead] > 0.0 else np.nan for robot, ahead, _ in hops]
    right.bar(places, ratios, 0.6, color=COLOURS[2])
    right.axhline(1.0, color="black", linewidth=0.8, linestyle="--")
    right.set(title="Turning, against the robot ahead (whole run)", ylabel="ratio of yaw rates' std [1]")
    for axes in (left, right):
        axes.set_xticks(places if len(hops) <= LEGEND_MAX else [], names if len(hops) <= LEGEND_MAX else [])
        axes.set_xlabel("hop: predecessor \u2192 follower")
    left.set_ylim(0.0, 1.3 * max([*peak, 1e-3]))
    left.legend(ncols=2, loc="upper center")


#             file                     size [inch]  title                                            function
FIGURES: tuple[tuple[str, tuple[float, float], str, Draw], ...] = (
    ("fig09_path_flow",         (10.0, 5.5), "Paths over the map (the paper's figure 9)",           path_flow),
    ("fig07_distance_error",    (10.0, 4.8), "Distance error (figure 7)",                           distance_error),
    ("fig08_orientation_error", (10.0, 7.5), "Orientation error (figure 8)",                        orientation_error),
    ("fig11_tracking",          (10.0, 6.0), "Tracking controller's output (figure 11)",            tracking),
    ("lease_timeline",          (10.0, 5.0), "Lease, terms and chain",                              timeline.draw),
    ("string_stability",        (10.0, 3.5), "String stability, hop by hop",                        _string_stability),
    ("leader_timeline",         (10.0, 3.0), "Who led, and what it took to replace a lost leader",  _leader_timeline),
)  # fmt: skip


def _saved(figure: Figure, kind: str, **options: Any) -> bytes:
    file = BytesIO()
    with _style():
        figure.savefig(file, format=kind, bbox_inches="tight", pad_inches=0.05, **options)
    return file.getvalue()


@contextmanager
def _style() -> Iterator[None]:
    with matplotlib.rc_context(FONT):
        yield
