"""The planner: clear of walls, the same whatever its budget, out of dead ends, past the team, honest when walled in."""

from __future__ import annotations

from itertools import pairwise
from math import atan2, hypot

import pytest

from lfa.agents.exploration.astar import CostToGo, forward, search
from lfa.agents.exploration.costmap import FREE, TIGHT_M, Costmap, prices_of
from lfa.agents.exploration.occupancy_grid import CELL_M, NEAR_PER_CELL, OCCUPIED, REACH, Grid, Point
from lfa.agents.exploration.path_planner import BARRED_AGAIN, CHECK_S, MATE_BARRED_S, RENEW_S, Planner
from lfa.protocol.geometry import Pose2D, wrap

RADIUS_M = 0.15
Box = tuple[float, float, float, float]


def ground(*boxes: Box, seen: bool = True) -> Grid:
    """10 m x 8 m, occupied in `boxes` (x1, y1, x2, y2), elsewhere free or unseen."""
    grid = Grid((-1.0, -1.0), (11.0, 9.0))
    if seen:
        grid.scores[:] = bytes([4]) * len(grid.scores)
    occupy(grid, boxes)
    return grid


def occupy(grid: Grid, boxes: tuple[Box, ...]) -> None:
    for cell in range(len(grid.scores)):
        x, y = grid.center(cell)
        if any(x1 < x < x2 and y1 < y < y2 for x1, y1, x2, y2 in boxes) and grid.cell(x, y) is not None:
            grid.scores[cell] = OCCUPIED
            for offset, value in grid.stamp:
                grid.near[cell + offset] = max(grid.near[cell + offset], value)


def plan(planner: Planner, here: Point, *, budget: int = 10**6, mates: tuple[Pose2D, ...] = (), at: float = 0.0) -> int:
    """Work until there is a route or none can be; the number of calls that it took."""
    number, searches = planner.number, planner.searches
    for calls in range(1, 100_000):
        planner.work(budget, here, mates, at)
        if planner.number != number or planner.searches != searches:
            return calls
    raise AssertionError("the search does not end")


def nearest_m(route: tuple[Point, ...], boxes: tuple[Box, ...]) -> float:
    """Least distance [m] from the route to a box."""
    points = [
        (a[0] + (b[0] - a[0]) * n / 10, a[1] + (b[1] - a[1]) * n / 10) for a, b in pairwise(route) for n in range(11)
    ]
    return min(hypot(max(x1 - x, 0.0, x - x2), max(y1 - y, 0.0, y - y2)) for x, y in points for x1, y1, x2, y2 in boxes)


WALL = (4.9, 0.0, 5.1, 6.0)
U = ((3.0, 3.0, 7.0, 3.2), (3.0, 5.0, 7.0, 5.2), (6.8, 3.0, 7.0, 5.2))
"""A dead end, open to the left."""


def test_the_route_goes_round_a_wall_and_keeps_more_than_the_radius_from_it() -> None:
    planner = Planner(ground(WALL), (8.0, 3.0), RADIUS_M)
    plan(planner, (2.0, 3.0))
    assert planner.route[0] == (2.0, 3.0) and planner.route[-1] == (8.0, 3.0)
    assert nearest_m(planner.route, (WALL,)) > RADIUS_M + 0.04


def test_where_there_is_room_the_route_keeps_to_the_middle() -> None:
    walls = ((2.0, 2.0, 8.0, 2.2), (2.0, 3.8, 8.0, 4.0))
    planner = Planner(ground(*walls), (9.0, 2.5), RADIUS_M)
    plan(planner, (1.0, 2.5))
    assert nearest_m(planner.route, walls) > 0.4


def test_a_route_has_no_corner_that_a_chain_cannot_follow() -> None:
    planner = Planner(ground(WALL), (8.0, 1.0), RADIUS_M)
    plan(planner, (2.0, 1.0))
    headings = [atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(planner.route[1:-1])]
    assert max(abs(wrap(b - a)) for a, b in pairwise(headings)) < 0.8


def test_the_route_is_the_same_whatever_the_budget() -> None:
    routes = []
    for budget in (1, 160, 10**6):
        planner = Planner(ground(WALL, *U), (8.0, 3.0), RADIUS_M)
        calls = plan(planner, (2.0, 4.0), budget=budget)
        routes.append(planner.route)
        assert budget > 1 or calls > 100, "one call looks at little more than its budget"
    assert routes[0] == routes[1] == routes[2]


def test_unseen_ground_is_crossed_when_known_ground_is_the_longer_way() -> None:
    planner = Planner(ground(seen=False), (8.0, 3.0), RADIUS_M)
    plan(planner, (2.0, 3.0))
    length = sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(planner.route))
    assert length == pytest.approx(6.0, rel=0.05)


def test_out_of_a_dead_end_the_route_leads_out_again() -> None:
    planner = Planner(ground(*U), (9.0, 4.1), RADIUS_M)
    plan(planner, (6.0, 4.1))
    assert min(x for x, _ in planner.route) < 3.0
    assert nearest_m(planner.route, U) > RADIUS_M


def test_the_way_out_leads_past_the_team_behind() -> None:
    behind = tuple(Pose2D(x, 4.1, 0.0) for x in (5.2, 4.4))
    planner = Planner(ground(*U), (9.0, 4.1), RADIUS_M)
    plan(planner, (6.0, 4.1), mates=behind)
    apart = min(hypot(x - mate.x, y - mate.y) for x, y in planner.route for mate in behind)
    assert apart > 2.0 * RADIUS_M


def test_a_map_that_contradicts_the_route_brings_another_one() -> None:
    planner = Planner(ground(), (8.0, 3.0), RADIUS_M)
    plan(planner, (2.0, 3.0))
    before = planner.route
    walled = ground(WALL)
    planner._grid.scores[:], planner._grid.near[:] = walled.scores, walled.near
    assert planner.blocked_m((2.0, 3.0)) is not None
    plan(planner, (2.0, 3.0), at=0.5)
    assert planner.route != before
    assert nearest_m(planner.route, (WALL,)) > RADIUS_M


HALL = (25.0, 25.0)
"""Goal in a hall of 30 m x 30 m, a first way to which takes many control steps."""
BUDGET = 160


def hall() -> tuple[Grid, Planner]:
    """A hall of unseen ground but for a wall before the goal, with a planner that has found its first way."""
    grid = Grid((-1.0, -1.0), (31.0, 31.0))
    occupy(grid, ((8.0, 20.0, 31.0, 20.2),))
    planner = Planner(grid, HALL, RADIUS_M)
    assert plan(planner, (20.0, 2.0), budget=BUDGET) > 150, "a search that is not at its end for seconds"
    return grid, planner


def length_m(route: tuple[Point, ...]) -> float:
    return sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(route))


@pytest.mark.parametrize("renewing", [False, True])
def test_a_way_round_what_the_map_shows_anew_is_found_within_a_few_control_steps(renewing: bool) -> None:
    grid, planner = hall()
    for _ in range(20):
        planner.work(BUDGET, (20.0, 2.0), (), RENEW_S if renewing else 0.0)
    wall = (16.0, 5.0, 24.0, 5.2)
    occupy(grid, (wall,))
    assert planner.blocked_m((20.0, 2.0)) is not None
    assert plan(planner, (20.0, 2.0), budget=BUDGET, at=RENEW_S + 2.0 * CHECK_S) < 80
    assert nearest_m(planner.route, (wall,)) > RADIUS_M


def test_a_much_cheaper_way_replaces_the_present_one_once_the_cost_to_go_is_renewed() -> None:
    grid, planner = hall()
    before_m = length_m(planner.route)
    grid.scores[:], grid.near[:] = bytes(len(grid.scores)), bytes(len(grid.near))
    for n in range(4):  # what was begun on the map before ends first
        planner.work(10**6, (20.0, 2.0), (), RENEW_S + 2.0 * CHECK_S * n)
    assert length_m(planner.route) < 0.9 * before_m


def test_a_search_by_the_cost_to_go_finds_the_cheapest_way_and_looks_at_little_else() -> None:
    boxes = (WALL, (2.0, 1.0, 2.2, 9.0), (6.5, 3.0, 6.7, 9.0))
    costmap = Costmap(ground(*boxes), prices_of(RADIUS_M))
    start, goal = costmap.settled((1.0, 6.0)), costmap.settled((8.0, 6.0))
    assert start is not None and goal is not None
    to_go = CostToGo(costmap.grid, goal)
    backward = sum(search(costmap, start, to_go))
    looked, steps = 0, forward(costmap, start, to_go)
    while True:
        try:
            looked += next(steps)
        except StopIteration as ended:
            cells = ended.value
            break
    assert costmap.price_of_cells(cells[::-1]) <= 1.02 * (to_go.cost[start] - 1)
    assert looked < 0.1 * backward


def test_a_goal_that_is_walled_in_is_reported_and_not_searched_for_in_the_whole_world() -> None:
    box = ((7.0, 2.0, 9.0, 2.2), (7.0, 4.0, 9.0, 4.2), (7.0, 2.0, 7.2, 4.2), (8.8, 2.0, 9.0, 4.2))
    planner = Planner(ground(*box), (8.0, 3.1), RADIUS_M)
    calls = plan(planner, (2.0, 3.0), budget=160)
    assert planner.route == () and planner.unreachable is not None and "walled in" in planner.unreachable
    assert calls < 10


def test_a_robot_that_is_walled_in_itself_finds_out_before_it_has_searched_the_world_outside() -> None:
    far = Grid((-20.0, -20.0), (40.0, 40.0))
    box = ((0.0, 0.0, 4.0, 0.2), (0.0, 3.8, 4.0, 4.0), (0.0, 0.0, 0.2, 4.0), (3.8, 0.0, 4.0, 4.0))
    occupy(far, box)
    planner = Planner(far, (30.0, 30.0), RADIUS_M)
    calls = plan(planner, (2.0, 2.0), budget=160)
    assert planner.unreachable is not None and "walled in" in planner.unreachable
    assert calls < 120


def test_a_goal_in_a_wall_is_reported() -> None:
    planner = Planner(ground((6.0, 1.0, 9.0, 5.0)), (7.5, 3.0), RADIUS_M)
    plan(planner, (2.0, 3.0))
    assert planner.unreachable == "no robot can stand at the goal"


def test_no_route_leads_through_what_is_to_be_kept_out_of() -> None:
    mask = (4.0, 1.0, 6.0, 5.0)
    planner = Planner(ground(), (8.0, 3.0), RADIUS_M, (mask,))
    plan(planner, (2.0, 3.0))
    assert nearest_m(planner.route, (mask,)) > 0.0


def test_prices_bar_only_what_no_body_passes() -> None:
    """Between the half cell's error and the radius a way may fit: dear, so that every roomier way is preferred."""
    prices = [
        ((REACH - near / NEAR_PER_CELL) * CELL_M, price)
        for near, price in enumerate(prices_of(RADIUS_M)[: NEAR_PER_CELL * REACH + 1])
    ]
    for clear_m, price in prices:
        assert (price == 0) == (clear_m < RADIUS_M - TIGHT_M - 1e-9), clear_m
        if RADIUS_M - TIGHT_M <= clear_m < RADIUS_M:
            assert price > 3 * FREE, f"{clear_m:.2f} m is tight"
    dear = [price for _, price in prices if price]
    assert dear == sorted(dear), "nearer is never cheaper"


@pytest.mark.parametrize("middle_m", [0.0, 0.02, 0.05, 0.07])
def test_no_gap_five_centimetres_wider_than_the_body_on_either_side_is_barred(middle_m: float) -> None:
    half_m = RADIUS_M + 0.05
    low, high = 3.0 + middle_m - half_m, 3.0 + middle_m + half_m
    planner = Planner(ground((5.0, 0.0, 5.2, low), (5.0, high, 5.2, 6.0)), (8.0, 3.0), RADIUS_M)
    plan(planner, (2.0, 3.0))
    assert planner.unreachable is None


def test_a_gap_in_which_the_body_did_not_fit_is_tried_again_where_it_is_the_only_way() -> None:
    gap = (5.05, 3.05)
    planner = Planner(ground((4.9, -2.0, 5.1, 2.9), (4.9, 3.2, 5.1, 9.0)), (8.0, 3.0), RADIUS_M)
    plan(planner, (2.0, 3.0))
    for n in range(1, BARRED_AGAIN + 1):
        planner.bar(gap, float(n))
        plan(planner, (2.0, 3.0), at=float(n))
        assert planner.route
    planner.bar(gap, 9.0)
    plan(planner, (2.0, 3.0), at=9.0)
    assert planner.route == ()
    assert planner.unreachable is not None


def test_ground_on_which_a_team_mate_stood_is_planned_through_again_once_it_may_have_gone() -> None:
    gap = (5.05, 3.05)
    planner = Planner(ground((4.9, -2.0, 5.1, 2.9), (4.9, 3.2, 5.1, 9.0)), (8.0, 3.0), RADIUS_M)
    for n in range(BARRED_AGAIN + 1):
        planner.bar(gap, float(n), mate=True)
        plan(planner, (2.0, 3.0), at=float(n))
    assert planner.route == ()
    plan(planner, (2.0, 3.0), at=BARRED_AGAIN + MATE_BARRED_S)
    assert planner.route
