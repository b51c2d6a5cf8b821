"""Top view of a run: walls, obstacles, terrain, the robots' paths, and the team's poses at several times."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import FigureBase
from matplotlib.patches import Circle, Polygon

from lfa.deploy.analysis import tracking_errors
from lfa.deploy.analysis.run_data import Run
from lfa.deploy.recording.mcap_reader import Array
from lfa.deploy.view.figures.style import CLEAR, label, look
from lfa.deploy.view.figures.time_panels import POINTS_MAX
from lfa.world.description.terrain import patches_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LABEL_M = 0.8
"""Least distance [m] between two times on the map: nearer ones would be printed over each other."""
STANCES = 7
"""Number of times at which the whole team is shown."""


def path_flow(figure: FigureBase, run: Run) -> None:
    axes = figure.subplots()
    _ground(axes, run)
    for robot, rows in run.seen.truth.items():
        step = max(1, rows.shape[0] * len(run.seen.truth) // POINTS_MAX)
        axes.plot(rows[::step, 1], rows[::step, 2], label=label(run, robot), linewidth=1.3, **look(run, robot))
    labels: list[Array] = []
    for t in np.linspace(0.0, run.seen.end_s, STANCES):
        _stance(axes, run, float(t), labels)
    goal = run.scenario.mission.goal_m
    axes.plot(*goal, marker="*", markersize=14, color="black", linestyle="none", label="goal", zorder=5)
    axes.margins(0.03, 0.15)
    axes.set(title=f"Path flow: {run.scenario.title}", xlabel="x in map [m]", ylabel="y in map [m]", aspect="equal")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)


def _ground(axes: Axes, run: Run) -> None:
    """Draw walls, obstacles and terrain; the path of a moving obstacle is dotted."""
    world = run.scenario.world
    for patch in patches_of(world):
        colours: dict[str, Any] = {
            "facecolor": "#DDD6C8" if patch.height_m > 0.0 else "#C8D3DD",
            "edgecolor": "#888888",
            "zorder": 1,
        }
        if patch.radius_m > 0.0:
            axes.add_patch(Circle((patch.x, patch.y), patch.radius_m, **colours))
        else:
            axes.add_patch(Polygon(patch.corners_m, **colours))
    for x1, y1, x2, y2 in world.walls_m:
        axes.plot([x1, x2], [y1, y2], color="#444444", linewidth=2.0)
    for index, obstacle in enumerate(world.obstacles):
        x, y = obstacle.center_m
        moved = run.seen.obstacles.get(index)
        if moved is not None:
            axes.plot(moved[:, 1], moved[:, 2], color="#888888", linestyle=":", linewidth=1.0)
        if obstacle.corners_m is not None:
            corners = [(x + dx, y + dy) for dx, dy in obstacle.corners_m]
            axes.add_patch(Polygon(corners, facecolor="#AAAAAA", edgecolor="#444444", zorder=2))
        else:
            axes.add_patch(Circle((x, y), obstacle.radius_m or 0.0, facecolor="#AAAAAA", edgecolor="#444444", zorder=2))


def _stance(axes: Axes, run: Run, t: float, labels: list[Array]) -> None:
    """Draw the pose of each robot at `t` [s], a line to its predecessor, and the time where none stands in `labels`."""
    at = {robot: rows[min(int(np.searchsorted(rows[:, 0], t)), rows.shape[0] - 1)]
          for robot, rows in run.seen.truth.items()}  # fmt: skip
    for robot, row in at.items():
        followed = run.errors.get(robot)
        i = -1 if followed is None else int(np.searchsorted(followed.t, t, side="right")) - 1
        stale = followed is None or i < 0 or t - followed.t[i] > tracking_errors.TRACKING_AGE_MAX_S
        ahead = None if followed is None or stale else at.get(int(followed.predecessor[i]))
        if ahead is not None:
            axes.plot([row[1], ahead[1]], [row[2], ahead[2]], color="#666666", linewidth=0.7, zorder=3)
        colour = look(run, robot)["color"]
        axes.plot(row[1], row[2], marker=(3, 0, float(np.degrees(row[3])) - 90.0), markersize=8, color=colour, zorder=4)
    highest = max(at.values(), key=lambda row: float(row[2]), default=None)
    if highest is not None and all(np.hypot(*(highest[1:3] - there)) > LABEL_M for there in labels):
        labels.append(highest[1:3])
        axes.annotate(f"{t:.0f} s", (highest[1], highest[2]), xytext=(0, 7), textcoords="offset points",
                      fontsize="small", ha="center", color="#333333", zorder=5, bbox=CLEAR)  # fmt: skip
