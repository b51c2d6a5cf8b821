"""Drawing of the paper's figures 7, 8 and 11; figure 9 is in `path_plot.py`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import FigureBase

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.tracking_errors import TrackingErrors
from lfa.deploy.recording.mcap_reader import Array
from lfa.deploy.view.figures.style import look
from lfa.deploy.view.figures.time_panels import POINTS_MAX, finish, plot, strip, thin


def distance_error(figure: FigureBase, run: Run) -> None:
    axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(5, 1))
    plot(axes, run, {robot: (e.t, e.distance) for robot, e in run.errors.items()})
    finish(axes, run, "Distance error of each follower, D - k", "D - k [m]", last=False)
    strip(below, run)


def orientation_error(figure: FigureBase, run: Run) -> None:
    *panels, below = figure.subplots(4, 1, sharex=True, height_ratios=(3, 3, 3, 1.2))
    table: tuple[tuple[str, Callable[[TrackingErrors], Array]], ...] = (
        ("against the slot that the leader asked for", lambda e: e.bearing_asked),
        ("against the predecessor's body (the paper's)", lambda e: e.bearing_body),
        ("of the own heading against the feasible one", lambda e: e.heading),
    )
    for axes, (title, pick) in zip(panels, table, strict=True):
        plot(axes, run, {robot: (e.t, np.degrees(pick(e))) for robot, e in run.errors.items()})
        finish(axes, run, f"Orientation error {title}", "error [deg]", last=False, legend=axes is panels[0])
    strip(below, run)


def tracking(figure: FigureBase, run: Run) -> None:
    (a, b), (c, d) = figure.subplots(2, 2, sharex=True)
    plot(a, run, {robot: (e.t, e.distance) for robot, e in run.errors.items()})
    finish(a, run, "(a) Distance error", "D - k [m]", last=False)
    plot(b, run, {robot: (e.t, np.degrees(e.bearing_asked)) for robot, e in run.errors.items()})
    finish(b, run, "(b) Orientation error", "error [deg]", last=False, legend=False)
    for robot, (t, v, w) in _velocities(run, leading=True).items():
        colour = look(run, robot)["color"]
        c.plot(*thin(t, v, POINTS_MAX // 2), label=f"v of robot {robot} [m/s]", color=colour, linewidth=1.6)
        turning = {"color": colour, "alpha": 0.6, "linewidth": 0.9, "linestyle": "--"}
        c.plot(*thin(t, w, POINTS_MAX // 2), label=f"omega of robot {robot} [rad/s]", **turning)
    finish(c, run, "(c) Leader velocity", "v [m/s], omega [rad/s]")
    plot(d, run, {robot: (t, v) for robot, (t, v, _) in _velocities(run, leading=False).items()})
    finish(d, run, "(d) Follower velocity", "v [m/s]")


def _velocities(run: Run, *, leading: bool) -> dict[int, tuple[Array, Array, Array]]:
    """Return time [s], v [m/s] and omega [rad/s] of each robot while it led, or while it did not; nan otherwise."""
    found = {}
    for robot, rows in run.seen.truth.items():
        led = run.led(robot, rows[:, 0])
        mask = led if leading else ~led
        if mask.any() and (leading or robot in run.errors):
            found[robot] = (rows[:, 0], np.where(mask, rows[:, 4], np.nan), np.where(mask, rows[:, 5], np.nan))
    return found
