"""Initial layout of the viewer: world, leader and radio on the left; errors, speeds and decisions on the right."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from lfa.deploy.view.rerun.scene import NAMED_MAX, TIMELINE
from lfa.world.description.load import Scenario, starts_of

MARGIN_M = 1.0
GRID_M, GRID = 1.0, (225, 225, 225)
HALF_VIEW = 0.5
"""Half of what the view shows, upwards, of a plane at distance 1; and its width for each unit of its height."""
ASPECT = 1.5
LIVE_S = 60.0
BESIDE = 0.16
"""Share of a panel's width that is left free behind the newest value, for the legend to lie beside the curves."""


def layout(
    scenario: Scenario | None, robots: int, *, lasted_s: float | None = None, plays: bool = False
) -> rrb.Blueprint:
    """Return a blueprint that shows all of a recording of `lasted_s` [s], or the last minute of a running fleet (None).

    It `plays` from the start, or shows the end, for a fleet the newest.
    Without a scenario the viewer chooses the bounds of the world.
    """
    few = robots <= NAMED_MAX
    axis = rrb.TimeAxis(view_range=_shown(lasted_s, BESIDE if few else 0.0))
    legend = rrb.PlotLegend(visible=few, corner=rrb.Corner2D.RightTop)

    def plot(origin: str, name: str, y: rrb.ScalarAxis | None = None) -> rrb.TimeSeriesView:
        return rrb.TimeSeriesView(origin=origin, name=name, axis_x=axis, axis_y=y, plot_legend=legend)

    world = rrb.Spatial3DView(
        origin="world",
        name="World from above: x to the right, y up, a line each metre",
        background=[255, 255, 255],
        line_grid=rrb.LineGrid3D(visible=True, spacing=GRID_M, plane=rr.components.Plane3D.XY, color=GRID),
        eye_controls=_from_above(scenario),
    )
    lease = rrb.StateTimelineView(
        origin="lease" if few else "lease/leader",
        name="Leader, term and roles",
        time_view=rrb.TimeAxis(view_range=_shown(lasted_s)),
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
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="playing" if plays else "following"),
    )


def _shown(lasted_s: float | None, free: float = 0.0) -> rr.TimeRange:
    """Return the times that a panel shows, the last `free` of its width behind the end."""
    length_s = LIVE_S if lasted_s is None else max(lasted_s, 1.0)
    behind_s = length_s * free / (1.0 - free)
    if lasted_s is None:
        cursor = rr.TimeRangeBoundary.cursor_relative
        return rr.TimeRange(start=cursor(seconds=-length_s), end=cursor(seconds=behind_s))
    ends = rr.TimeRangeBoundary.absolute
    return rr.TimeRange(start=ends(seconds=0.0), end=ends(seconds=length_s + behind_s))


def _from_above(scenario: Scenario | None) -> rrb.EyeControls3D | None:
    """Return an eye above start poses, route, obstacles and walls, with y up; None without a scenario."""
    if scenario is None:
        return None
    world, route = scenario.world, scenario.mission.leading.route_m
    points = [(0.0, 0.0), *route, *(o.center_m for o in world.obstacles), *((s.x, s.y) for s in starts_of(scenario))]
    points += [end for x1, y1, x2, y2 in world.walls_m for end in ((x1, y1), (x2, y2))]
    low_x, high_x = min(x for x, _ in points) - MARGIN_M, max(x for x, _ in points) + MARGIN_M
    low_y, high_y = min(y for _, y in points) - MARGIN_M, max(y for _, y in points) + MARGIN_M
    x, y = 0.5 * (low_x + high_x), 0.5 * (low_y + high_y)
    height_m = 0.5 * max(high_y - low_y, (high_x - low_x) / ASPECT) / HALF_VIEW
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=(x, y, height_m), look_target=(x, y, 0.0), eye_up=(0.0, 1.0, 0.0)
    )
