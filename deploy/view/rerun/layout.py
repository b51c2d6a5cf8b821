"""Initial layout of the viewer: world, leader and radio on the left; errors, speeds and decisions on the right."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from lfa.deploy.view.rerun.scene import NAMED_MAX, TIMELINE
from lfa.world.description.load import Scenario, starts_of

MARGIN_M = 1.0
LIVE_S = 60.0


def layout(scenario: Scenario | None, robots: int, *, lasted_s: float | None = None) -> rrb.Blueprint:
    """Return a blueprint that shows all of a recording of `lasted_s` [s], or the last minute of a running fleet (None).

    Without a scenario the viewer chooses the bounds of the world.
    """
    few = robots <= NAMED_MAX
    axis = rrb.TimeAxis(view_range=_shown(lasted_s))
    legend = rrb.PlotLegend(visible=few)

    def plot(origin: str, name: str, y: rrb.ScalarAxis | None = None) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(origin=origin, name=name, axis_x=axis, axis_y=y, plot_legend=legend)

    world = rrb.Spatial2DView(
        origin="world",
        name="World [m] (y is drawn upwards, shown negative)",
        background=[255, 255, 255],
        visual_bounds=_bounds(scenario),
    )
    lease = rrb.StateTimelineView(
        origin="lease" if few else "lease/leader", name="Leader, term and roles", time_view=axis
    )
    percent = rrb.ScalarAxis(range=(-2.0, 102.0))
    below = rrb.Horizontal(lease, plot("radio", "Radio: rows of the table lost [%]", percent), column_shares=[3, 2])
    right = rrb.Vertical(
        plot("errors/distance", "Distance error D - k [m]"),
        plot("errors/bearing", "Orientation error [deg]"),
        plot("speeds", "Speed [m/s]"),
        rrb.Tabs(
            rrb.TextLogView(
                origin="log",
                name="Decisions and events",
                columns=rrb.TextLogColumns(text_log_columns=["loglevel", "body"]),
            ),
            plot("errors/heading", "Heading error [deg]"),
            plot("processes/lag", "Loop lag [ms]"),
        ),
        row_shares=[3, 3, 2, 3],
    )
    left = rrb.Vertical(world, below, row_shares=[7, 3] if few else [6, 1])
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
    )


def _shown(lasted_s: float | None) -> rr.TimeRange:
    if lasted_s is None:
        cursor = rr.TimeRangeBoundary.cursor_relative
        return rr.TimeRange(start=cursor(seconds=-LIVE_S), end=cursor(seconds=0.0))
    ends = rr.TimeRangeBoundary.absolute
    return rr.TimeRange(start=ends(seconds=0.0), end=ends(seconds=max(lasted_s, 1.0)))


def _bounds(scenario: Scenario | None) -> rrb.VisualBounds2D | None:
    """Return bounds around start poses, route, obstacles and walls; None without a scenario."""
    if scenario is None:
        return None
    world, route = scenario.world, scenario.mission.leading.route_m
    points = [(0.0, 0.0), *route, *(o.center_m for o in world.obstacles), *((s.x, s.y) for s in starts_of(scenario))]
    points += [end for x1, y1, x2, y2 in world.walls_m for end in ((x1, y1), (x2, y2))]
    low_x, high_x = min(x for x, _ in points) - MARGIN_M, max(x for x, _ in points) + MARGIN_M
    low_y, high_y = min(y for _, y in points) - MARGIN_M, max(y for _, y in points) + MARGIN_M
    return rrb.VisualBounds2D(x_range=[low_x, high_x], y_range=[-high_y, -low_y])
