"""`figures/*.png` of a run folder: paths, distance errors, who led. Matplotlib is imported when a figure is drawn."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from protocol.mission import Refused

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from deploy.look.chronicle import Line
    from deploy.look.trace import Trace
    from world.scenario import Scenario

FIGURES = "figures"
# Okabe and Ito's palette: told apart with any colour vision, and in print by the line styles below.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
TERM_SHARE_MIN = 0.15  # of the run: a shorter bar has no room for its term
STYLES = ("-", "--", "-.", ":")


def command(folder: Annotated[Path, typer.Argument(help="A run folder.")]) -> int:
    """Draw the figures of a run folder anew."""
    if not (folder / "recording.mcap").is_file():
        raise Refused(f"{folder}: no run folder, it has no recording.mcap")
    for path in draw(folder):
        print(path)
    return 0


def draw(folder: Path) -> list[Path]:
    """Draw all figures of the run in `folder`; their files."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    from deploy.look import chronicle, trace
    from deploy.run.folder import scenario_of

    scenario, seen, events = scenario_of(folder), trace.read(folder), chronicle.lines(folder)
    (folder / FIGURES).mkdir(exist_ok=True)
    paths = []
    for name, (width, height), figure_of in _TABLE:
        figure, axes = pyplot.subplots(figsize=(width, height), layout="constrained")
        figure_of(axes, scenario, seen, events)
        paths.append(folder / FIGURES / f"{name}.png")
        figure.savefig(paths[-1], dpi=120)
        pyplot.close(figure)
    return paths


def _paths(axes: Axes, scenario: Scenario, seen: Trace, _events: list[Line]) -> None:
    from matplotlib.patches import Circle, Polygon

    for x1, y1, x2, y2 in scenario.world.walls_m:
        axes.plot([x1, x2], [y1, y2], color="#444444", linewidth=2.0)
    for index, obstacle in enumerate(scenario.world.obstacles):
        x, y = obstacle.center_m
        if obstacle.corners_m is not None:
            corners = [(x + dx, y + dy) for dx, dy in obstacle.corners_m]
            axes.add_patch(Polygon(corners, color="#999999"))
        else:
            axes.add_patch(Circle((x, y), obstacle.radius_m or 0.0, color="#999999"))
        if index in seen.obstacles:
            axes.plot(seen.obstacles[index][:, 1], seen.obstacles[index][:, 2], color="#999999", linestyle=":")
    for n, (robot, rows) in enumerate(seen.truth.items()):
        axes.plot(rows[:, 1], rows[:, 2], label=f"robot {robot}", **_look(n))
        axes.plot(rows[-1, 1], rows[-1, 2], marker="o", color=_look(n)["color"], markersize=5)
    axes.plot(*scenario.mission.goal_m, marker="*", markersize=14, color="black", linestyle="none", label="goal")
    axes.set(title=f"Paths: {scenario.title}", xlabel="x in map [m]", ylabel="y in map [m]", aspect="equal")
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))


def _distance_error(axes: Axes, scenario: Scenario, seen: Trace, events: list[Line]) -> None:
    from deploy.look import errors

    for n, robot in enumerate(seen.truth):
        followed = errors.of_follower(seen, robot)
        if followed is not None:
            axes.plot(followed.t, followed.distance, label=f"robot {robot}", linewidth=1.0, **_look(n))
    _mark_faults(axes, events)
    axes.set(title="Distance error of each follower", xlabel="time [s]", ylabel="D - k [m]")
    axes.grid(alpha=0.3)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best")


def _leader(axes: Axes, scenario: Scenario, seen: Trace, events: list[Line]) -> None:
    from deploy.look import chronicle

    robots = list(scenario.mission.robots)
    for reign in chronicle.reigns(events):
        until_s = seen.end_s if reign.until_s is None else reign.until_s
        n = robots.index(reign.robot_id) if reign.robot_id in robots else 0
        lasted_s = until_s - reign.from_s
        axes.barh(reign.robot_id, lasted_s, left=reign.from_s, height=0.6, color=_look(n)["color"], edgecolor="white")
        if lasted_s > TERM_SHARE_MIN * seen.end_s:
            axes.annotate(f"term {reign.term[0]}", (reign.from_s, reign.robot_id), xytext=(4, 0), va="center",
                          textcoords="offset points", color="white")  # fmt: skip
    _mark_faults(axes, events)
    axes.set(title="Who led", xlabel="time [s]", ylabel="robot", xlim=(0.0, max(seen.end_s, 1.0)))
    axes.set_yticks(robots)
    axes.set_ylim(min(robots) - 0.6, max(robots) + 0.6)


def _mark_faults(axes: Axes, events: list[Line]) -> None:
    from deploy.look import chronicle

    for fault in chronicle.faults(events):
        axes.axvline(fault.at_s, color="black", linewidth=0.8, linestyle="--")
        axes.annotate(f"{fault.kind} {fault.target}", (fault.at_s, 1.0), xycoords=("data", "axes fraction"),
                      xytext=(3, -10), textcoords="offset points", fontsize=8)  # fmt: skip


def _look(n: int) -> dict[str, Any]:
    return {"color": COLOURS[n % len(COLOURS)], "linestyle": STYLES[n // len(COLOURS) % len(STYLES)]}


#        file              size [inch]  what is drawn
_TABLE = (
    ("paths",          (10.0, 6.0), _paths),
    ("distance_error", (10.0, 4.5), _distance_error),
    ("leader",         (10.0, 3.0), _leader),
)  # fmt: skip
