"""Data of the interactive charts of the report: errors and speeds over time, one line for each robot.

The script `charts.js` draws them with uPlot (uplot/LICENSE); without a script the page shows the figures instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from html import escape
from math import isnan
from typing import NamedTuple

import msgspec
import numpy as np

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.summary import Summary
from lfa.deploy.analysis.tracking_errors import TrackingErrors
from lfa.deploy.recording.mcap_reader import Array
from lfa.deploy.robot_colours import as_hex, robot_colour
from lfa.deploy.view.figures.time_panels import marks
from lfa.deploy.view.report.html import in_deg, in_mm

POINTS_MAX = 20_000
"""Sum of the points of all lines of a chart."""
BINS_MAX = 2000

Pick = Callable[[TrackingErrors], Array]


class Chart(NamedTuple):
    title: str
    unit: str
    scale: float
    pick: Pick
    rms: str
    """Field of a robot's summary with the rms value of the line."""


ERRORS = {
    "fig07_distance_error": (
        Chart("Distance error D - k", "mm", 1000.0, lambda e: e.distance, "distance_error_rms_m"),
    ),
    "fig08_orientation_error": (
        Chart("Orientation error, to the slot asked for", "deg", 57.29578, lambda e: e.bearing_asked, ""),
        Chart("Orientation error, to the predecessor's body (the paper's)", "deg", 57.29578, lambda e: e.bearing_body,
              "bearing_error_body_rms_rad"),
        Chart("Heading error", "deg", 57.29578, lambda e: e.heading, "heading_error_rms_rad"),
    ),
}  # fmt: skip
"""Charts of errors, by the figure that they stand for."""


def charts_of(figure: str, run: Run, s: Summary) -> str:
    """Return the charts that stand for a figure, as HTML; empty for a figure that has none."""
    if figure == "fig11_tracking":
        speeds = {robot: (rows[:, 0], rows[:, 4]) for robot, rows in run.seen.truth.items()}
        return _html(run, "Speed", "m/s", speeds, {})
    found = []
    for chart in ERRORS.get(figure, ()):
        lines = {robot: (e.t, chart.scale * chart.pick(e)) for robot, e in run.errors.items()}
        show = in_mm if chart.unit == "mm" else in_deg
        rms = {r.id: show(getattr(r, chart.rms)) for r in s.robots if chart.rms and getattr(r, chart.rms) is not None}
        found.append(_html(run, chart.title, chart.unit, lines, rms))
    return "".join(found)


def _html(run: Run, title: str, unit: str, lines: Mapping[int, tuple[Array, Array]], rms: Mapping[int, str]) -> str:
    """Return one chart's place and data. `rms`: what the table says of a line, shown beside its name."""
    if not lines:
        return ""
    bins = min(BINS_MAX, POINTS_MAX // len(lines))
    edges = np.linspace(0.0, max(run.seen.end_s, 1.0), bins + 1)
    series = []
    for robot, (t, y) in lines.items():
        of = len(run.robots)
        colour = as_hex(robot_colour(run.robots.index(robot) if robot in run.robots else 0, of))
        name = f"robot {robot}" + (f", rms {rms[robot]}" if robot in rms else "")
        series.append({"name": name, "colour": colour, "y": _binned(t, y, edges)})
    data = {
        "title": title,
        "unit": unit,
        "t": [round(float(at), 3) for at in edges[:-1]],
        "series": series,
        "marks": [{"t": round(at, 3), "text": text} for at, text, _ in marks(run)],
    }
    packed = msgspec.json.encode(data).decode().replace("<", "\\u003c")
    return f'<div class="chart" data-title="{escape(title)}"><script type="application/json">{packed}</script></div>'


def _binned(t: Array, y: Array, edges: Array) -> list[float | None]:
    """Return for each bin the value that is farthest from zero, so that no spike is lost; None for a bin without."""
    found: list[float | None] = [None] * (edges.size - 1)
    where = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, edges.size - 2)
    for n, value in zip(where.tolist(), y.tolist(), strict=True):
        now = found[n]
        if not isnan(value) and (now is None or abs(value) > abs(now)):
            found[n] = value
    return [None if value is None else float(f"{value:.4g}") for value in found]
