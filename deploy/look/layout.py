"""The viewer's first sight of a fleet: the world on the left, who leads below it, errors and speeds on the right."""

from __future__ import annotations

import rerun.blueprint as rrb

from deploy.look.scene import NAMED_MAX, TIMELINE
from world.scenario import Scenario, starts_of

MARGIN_M = 1.0


def layout(scenario: Scenario | None, robots: int, *, follow: bool) -> rrb.Blueprint:
    """A blueprint; `follow` keeps to the newest data. Without a scenario the world's bounds are the viewer's guess."""
    few = robots <= NAMED_MAX
    world = rrb.Spatial2DView(
        origin="world",
        name="World [m] (y is drawn upwards, shown negative)",
        background=[255, 255, 255],
        visual_bounds=_bounds(scenario),
    )
    plots = [
        ("errors/distance", "Distance error D - k [m]"),
        ("errors/bearing", "Orientation error [deg]"),
        ("speeds", "Speed [m/s]"),
    ]
    legend = rrb.PlotLegend(visible=few)
    right = rrb.Vertical(
        *(rrb.TimeSeriesView(origin=origin, name=name, plot_legend=legend) for origin, name in plots),
        rrb.Tabs(
            rrb.TextLogView(origin="log", name="Decisions and events"),
            rrb.TimeSeriesView(origin="errors/heading", name="Heading error [deg]", plot_legend=legend),
            rrb.TimeSeriesView(origin="processes/lag", name="Loop lag [ms]", plot_legend=legend),
        ),
        row_shares=[3, 3, 2, 3],
    )
    lease = rrb.StateTimelineView(origin="lease" if few else "lease/leader", name="Leader, term and roles")
    left = rrb.Vertical(world, lease, row_shares=[3, 1] if few else [6, 1])
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[3, 2]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following" if follow else "paused"),
    )


def _bounds(scenario: Scenario | None) -> rrb.VisualBounds2D | None:
    """Everything that is known to stand somewhere."""
    if scenario is None:
        return None
    world, route = scenario.world, scenario.mission.leading.route_m
    points = [(0.0, 0.0), *route, *(o.center_m for o in world.obstacles), *((s.x, s.y) for s in starts_of(scenario))]
    points += [end for x1, y1, x2, y2 in world.walls_m for end in ((x1, y1), (x2, y2))]
    low_x, high_x = min(x for x, _ in points) - MARGIN_M, max(x for x, _ in points) + MARGIN_M
    low_y, high_y = min(y for _, y in points) - MARGIN_M, max(y for _, y in points) + MARGIN_M
    return rrb.VisualBounds2D(x_range=[low_x, high_x], y_range=[-high_y, -low_y])
