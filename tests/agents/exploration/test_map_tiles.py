"""What an explorer shows of its map: bounded pieces, near and new ones first, everything known in the end."""

from __future__ import annotations

from lfa.agents.exploration.map_tiles import TILE_CELLS, Shown, Tiles
from lfa.agents.exploration.occupancy_grid import CELL_M, OCCUPIED, Grid

SIDE_M = TILE_CELLS * CELL_M
SEEN = 3


def _grid(*, wide: int) -> Grid:
    """So many tiles a side, of which nobody has seen anything."""
    return Grid((0.0, 0.0), (wide * SIDE_M - CELL_M, wide * SIDE_M - CELL_M))


def _mark(grid: Grid, x: float, y: float, score: int) -> None:
    cell = grid.cell(x, y)
    assert cell is not None
    grid.scores[cell] = score


def _corner(shown: Shown | None) -> tuple[float, float] | None:
    return None if shown is None else (round(shown[1][0], 6), round(shown[1][1], 6))


def test_of_unseen_ground_nothing_is_shown() -> None:
    tiles = Tiles(_grid(wide=3))
    assert [tiles.next(10.0, 10.0) for _ in range(20)] == [None] * 20


def test_a_tile_tells_unseen_free_and_occupied_cells_from_its_lower_left_corner() -> None:
    grid = _grid(wide=2)
    _mark(grid, SIDE_M + 0.05, SIDE_M + 0.05, SEEN)
    _mark(grid, SIDE_M + 0.05, SIDE_M + 0.15, OCCUPIED)
    cell_m, corner, columns, cells = next(filter(None, (Tiles(grid).next(9.0, 9.0) for _ in range(1))))
    assert (cell_m, columns, len(cells)) == (CELL_M, TILE_CELLS, TILE_CELLS**2)
    assert (round(corner[0], 6), round(corner[1], 6)) == (SIDE_M, SIDE_M)
    assert (cells[0], cells[1], cells[columns]) == (1, 0, 2)


def test_what_changed_around_the_robot_is_shown_within_two_calls() -> None:
    grid = _grid(wide=12)
    for n in range(12):  # known ground everywhere, all of it shown before
        for m in range(12):
            _mark(grid, (n + 0.5) * SIDE_M, (m + 0.5) * SIDE_M, SEEN)
    tiles, (x, y) = Tiles(grid), (5.5 * SIDE_M, 5.5 * SIDE_M)
    for _ in range(2 * 144 + 2):
        tiles.next(x, y)
    _mark(grid, x + 0.5, y, OCCUPIED)
    assert (round(5 * SIDE_M, 6), round(5 * SIDE_M, 6)) in {_corner(tiles.next(x, y)) for _ in range(2)}


def test_everything_known_comes_round_again_for_views_that_come_late() -> None:
    grid = _grid(wide=4)
    _mark(grid, 1.0, 1.0, SEEN)
    _mark(grid, 3.5 * SIDE_M, 3.5 * SIDE_M, SEEN)
    tiles = Tiles(grid)
    for _ in range(50):
        tiles.next(1.0, 1.0)
    later = {_corner(tiles.next(1.0, 1.0)) for _ in range(8)}
    assert {(0.0, 0.0), (round(3 * SIDE_M, 6), round(3 * SIDE_M, 6))} <= later
