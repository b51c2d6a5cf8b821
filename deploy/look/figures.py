"""The figures of a run: those of the paper (7, 8, 9, 11) and what the paper has none of. One table
for PNGs and reports.

Lines are thinned to what a page can show, with every spike kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure, FigureBase
from matplotlib.patches import Circle, Polygon

from deploy.look import chronicle, errors, timeline
from deploy.look.errors import Errors
from deploy.look.marks import COLOURS, LEGEND_MAX, label, look
from deploy.look.readings import Run
from deploy.look.trace import Array
from world.terrain import patches_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS_MAX = 8000  # on all lines of one panel together
STANCES = 6  # how often a path flow shows the whole team
TERM_SHARE_MIN = 0.15  # of the run: a shorter bar has no room for its term
FONT: dict[Any, Any] = {"font.size": 9.0, "axes.titlesize": 10.0, "axes.grid": True, "grid.alpha": 0.3,
        "legend.fontsize": 8.0, "axes.axisbelow": True, "axes.spines.top": False, "axes.spines.right": False,
        "svg.hashsalt": "lfa"}  # fmt: skip


Draw = Callable[[FigureBase, Run], None]


def png(figure: Figure) -> bytes:
    return _saved(figure, "png", dpi=120)


def svg(figure: Figure) -> bytes:
    return _saved(figure, "svg", metadata={"Date": None})


def drawn(name: str, run: Run) -> Figure:
    """The figure called `name` of FIGURES."""
    (width, height), draw = next((size, draw) for known, size, _, draw in FIGURES if known == name)
    with _style():
        figure = Figure(figsize=(width, height), layout="constrained")
        draw(figure, run)
    return figure


def overview(run: Run) -> Figure:
    """World, leaders, errors and speeds on one sheet, laid out as the viewer's."""
    with _style():
        figure = Figure(figsize=(16.0, 10.0), layout="constrained")
        grid = figure.add_gridspec(20, 5)
        parts = ((grid[:15, :3], _path_flow), (grid[15:, :3], _leader_timeline),
                 (grid[:8, 3:], _distance_error), (grid[8:, 3:], _orientation_error))  # fmt: skip
        for place, draw in parts:
            draw(figure.add_subfigure(place), run)
    return figure


# --- the paper's ----------------------------------------------------------------------------------------------------


def _distance_error(figure: FigureBase, run: Run) -> None:
    axes = figure.subplots()
    _lines(axes, run, {robot: (e.t, e.distance) for robot, e in run.errors.items()})
    _finish(axes, run, "Distance error of each follower", "D - k [m]")


def _orientation_error(figure: FigureBase, run: Run) -> None:
    panels = figure.subplots(3, sharex=True)
    table: tuple[tuple[str, Callable[[Errors], Array]], ...] = (
        ("against the commanded slot", lambda e: e.bearing),
        ("against the predecessor's body (the paper's)", lambda e: e.bearing_body),
        ("of the own heading against the feasible one", lambda e: e.heading),
    )
    for axes, (title, pick) in zip(panels, table, strict=True):
        _lines(axes, run, {robot: (e.t, np.degrees(pick(e))) for robot, e in run.errors.items()})
        _finish(axes, run, f"Orientation error {title}", "[deg]", last=axes is panels[-1], legend=axes is panels[0])


def _path_flow(figure: FigureBase, run: Run) -> None:
    axes = figure.subplots()
    _ground(axes, run)
    for robot, rows in run.seen.truth.items():
        step = max(1, rows.shape[0] * len(run.seen.truth) // POINTS_MAX)
        axes.plot(rows[::step, 1], rows[::step, 2], label=label(run, robot), linewidth=1.3, **look(run, robot))
    for t in np.linspace(0.0, run.seen.end_s, STANCES):
        _stance(axes, run, float(t))
    goal = run.scenario.mission.goal_m
    axes.plot(*goal, marker="*", markersize=14, color="black", linestyle="none", label="goal", zorder=5)
    axes.set(title=f"Path flow: {run.scenario.title}", xlabel="x in map [m]", ylabel="y in map [m]", aspect="equal")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)


def _tracking(figure: FigureBase, run: Run) -> None:
    (a, b), (c, d) = figure.subplots(2, 2, sharex=True)
    _lines(a, run, {robot: (e.t, e.distance) for robot, e in run.errors.items()})
    _finish(a, run, "(a) Distance error", "D - k [m]", last=False)
    _lines(b, run, {robot: (e.t, np.degrees(e.bearing)) for robot, e in run.errors.items()})
    _finish(b, run, "(b) Orientation error", "[deg]", last=False, legend=False)
    for robot, (t, v, w) in _velocities(run, leading=True).items():
        c.plot(*_thin(t, v, POINTS_MAX // 2), label=f"v of robot {robot} [m/s]", **look(run, robot))
        c.plot(*_thin(t, w, POINTS_MAX // 2), label=f"omega of robot {robot} [rad/s]", alpha=0.5, **look(run, robot))
    _finish(c, run, "(c) Leader velocity", "v [m/s], omega [rad/s]")
    _lines(d, run, {robot: (t, v) for robot, (t, v, _) in _velocities(run, leading=False).items()})
    _finish(d, run, "(d) Follower velocity", "v [m/s]")


# --- what the paper has none of -------------------------------------------------------------------------------------


def _leader_timeline(figure: FigureBase, run: Run) -> None:
    axes, end_s = figure.subplots(), max(run.seen.end_s, 1.0)
    for reign in run.reigns:
        lasted_s = (end_s if reign.until_s is None else reign.until_s) - reign.from_s
        colour = look(run, reign.robot_id)["color"]
        axes.barh(reign.robot_id, lasted_s, left=reign.from_s, height=0.6, color=colour, edgecolor="white")
        if lasted_s > TERM_SHARE_MIN * end_s:
            axes.annotate(f"term {reign.term[0]}", (reign.from_s, reign.robot_id), xytext=(4, 0), va="center",
                          textcoords="offset points", color="white")  # fmt: skip
    for failover in chronicle.failovers(run.events, run.reigns):
        if failover.leader is not None and failover.first_command_ms is not None:
            axes.annotate(f"first command after {failover.first_command_ms:.0f} ms", (failover.at_s, failover.leader),
                          xytext=(4, 14), textcoords="offset points", fontsize=8)  # fmt: skip
    _finish(axes, run, "Who led", "robot")
    shown = [robot for robot in run.robots if len(run.robots) <= LEGEND_MAX or label(run, robot)]
    axes.set_yticks(shown)
    axes.set(xlim=(0.0, end_s), ylim=(max(run.robots) + 0.8, min(run.robots) - 0.8))


def _string_stability(figure: FigureBase, run: Run) -> None:
    """Along the last chain: how large an error each follower keeps, how lively each turns against the one ahead."""
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


#             file                     size [inch]  title                                            what is drawn
FIGURES: tuple[tuple[str, tuple[float, float], str, Draw], ...] = (
    ("fig09_path_flow",         (10.0, 5.5), "Paths over the map (the paper's figure 9)",           _path_flow),
    ("fig07_distance_error",    (10.0, 4.0), "Distance error (figure 7)",                           _distance_error),
    ("fig08_orientation_error", (10.0, 6.5), "Orientation error (figure 8)",                        _orientation_error),
    ("fig11_tracking",          (10.0, 6.0), "Tracking controller's output (figure 11)",            _tracking),
    ("lease_timeline",          (10.0, 5.0), "Lease, terms and chain",                              timeline.draw),
    ("string_stability",        (10.0, 3.5), "String stability, hop by hop",                        _string_stability),
    ("leader_timeline",         (10.0, 3.0), "Who led, and what it took to replace a lost leader",  _leader_timeline),
)  # fmt: skip


# --- parts of figures -----------------------------------------------------------------------------------------------


def _lines(axes: Axes, run: Run, of_robots: dict[int, tuple[Array, Array]]) -> None:
    most = POINTS_MAX // max(1, len(of_robots))
    for robot, (t, y) in of_robots.items():
        axes.plot(*_unwrapped(*_thin(t, y, most)), label=label(run, robot), linewidth=1.1, **look(run, robot))


def _finish(axes: Axes, run: Run, title: str, y_label: str, *, last: bool = True, legend: bool = True) -> None:
    """Faults as marks, names, units; a legend where there is something to name."""
    for fault in chronicle.faults(run.events):
        axes.axvline(fault.at_s, color="black", linewidth=0.8, linestyle=":")
        if legend:
            axes.annotate(f"{fault.kind} {fault.target}", (fault.at_s, 1.0), xycoords=("data", "axes fraction"),
                          xytext=(3, -9), textcoords="offset points", fontsize=8)  # fmt: skip
    axes.set(title=title, ylabel=y_label, xlim=(0.0, max(run.seen.end_s, 1.0)))
    if last:
        axes.set_xlabel("time [s]")
    if legend and axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best", ncols=2)


def _ground(axes: Axes, run: Run) -> None:
    """Walls, obstacles and terrain where they were; a moving one's way is dotted."""
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


def _stance(axes: Axes, run: Run, t: float) -> None:
    """Where all stood at `t`, each with its heading, and who followed whom."""
    at = {robot: rows[min(int(np.searchsorted(rows[:, 0], t)), rows.shape[0] - 1)]
          for robot, rows in run.seen.truth.items()}  # fmt: skip
    for robot, row in at.items():
        followed = run.errors.get(robot)
        i = -1 if followed is None else int(np.searchsorted(followed.t, t, side="right")) - 1
        stale = followed is None or i < 0 or t - followed.t[i] > errors.TRACKING_AGE_MAX_S
        ahead = None if followed is None or stale else at.get(int(followed.predecessor[i]))
        if ahead is not None:
            axes.plot([row[1], ahead[1]], [row[2], ahead[2]], color="#666666", linewidth=0.7, zorder=3)
        colour = look(run, robot)["color"]
        axes.plot(row[1], row[2], marker=(3, 0, float(np.degrees(row[3])) - 90.0), markersize=8, color=colour, zorder=4)


def _velocities(run: Run, *, leading: bool) -> dict[int, tuple[Array, Array, Array]]:
    """Time, v and omega of each robot while it led, or while it did not; gaps are not drawn over."""
    found = {}
    for robot, rows in run.seen.truth.items():
        led = np.zeros(rows.shape[0], dtype=bool)
        for reign in run.reigns:
            if reign.robot_id == robot:
                led |= (rows[:, 0] >= reign.from_s) & (rows[:, 0] < (reign.until_s or np.inf))
        mask = led if leading else ~led
        if mask.any() and (leading or robot in run.errors):
            found[robot] = (rows[:, 0], np.where(mask, rows[:, 4], np.nan), np.where(mask, rows[:, 5], np.nan))
    return found


def _unwrapped(t: Array, y: Array) -> tuple[Array, Array]:
    """No line across the plot where an angle [deg] goes over from -180 to 180."""
    over = np.flatnonzero(np.abs(np.diff(y)) > 270.0) + 1
    return np.insert(t, over, t[over]), np.insert(y, over, np.nan)


def _thin(t: Array, y: Array, most: int) -> tuple[Array, Array]:
    """At most about `most` points: of each stretch its least and its largest, in their order."""
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


def _saved(figure: Figure, kind: str, **options: Any) -> bytes:
    file = BytesIO()
    with _style():
        figure.savefig(file, format=kind, bbox_inches="tight", pad_inches=0.05, **options)
    return file.getvalue()


@contextmanager
def _style() -> Iterator[None]:
    with matplotlib.rc_context(FONT):
        yield
