"""Tiles of a leader's map for views: one tile at a time, so that a message is bounded and the work of a control step
does not grow with the map. Every other tile is one near the robot that has changed; in between, all known tiles are
sent in turn, for views that join late.
"""

from __future__ import annotations

from math import floor
from zlib import crc32

from lfa.agents.exploration.occupancy_grid import CELL_M, OCCUPIED, Grid, Point

TILE_CELLS = 64
LOOKED_MAX = 24
"""Maximum number of tiles that one call checks for content."""
SHOWN = bytes(0 if score == 0 else 1 if score < OCCUPIED else 2 for score in range(256))
AROUND = tuple((dx, dy) for dy in (0, 1, -1) for dx in (0, 1, -1))

Tile = tuple[int, int]
Shown = tuple[float, Point, int, bytes]
"""Side of a cell [m], lower left corner in `map` [m], columns, cells row by row."""


class Tiles:
    """Tiles of one grid; `next` returns one tile per call."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._columns, self._rows = -(-grid.columns // TILE_CELLS), -(-grid.rows // TILE_CELLS)
        self._sums: dict[Tile, int] = {}
        """Checksum of each tile as it was sent last."""
        self._swept = 0
        self._sweeps = False

    def next(self, x: float, y: float) -> Shown | None:
        """Return a tile for a robot at (x, y) in `map`; None if nothing is new."""
        self._sweeps = not self._sweeps
        tile = self._sweep() if self._sweeps else self._changed(x, y)
        if tile is None:
            return None
        cells, columns = self._cells(tile), min(TILE_CELLS, self._grid.columns - tile[0] * TILE_CELLS)
        self._sums[tile] = crc32(cells)
        side_m = TILE_CELLS * CELL_M
        corner = self._grid.x0_m + tile[0] * side_m, self._grid.y0_m + tile[1] * side_m
        return CELL_M, corner, columns, cells

    def _changed(self, x: float, y: float) -> Tile | None:
        """Return a tile near the robot that differs from what was sent; None if there is none."""
        side_m = TILE_CELLS * CELL_M
        column, row = floor((x - self._grid.x0_m) / side_m), floor((y - self._grid.y0_m) / side_m)
        for dx, dy in AROUND:
            tile = column + dx, row + dy
            if 0 <= tile[0] < self._columns and 0 <= tile[1] < self._rows:
                cells = self._cells(tile)
                if any(cells) and self._sums.get(tile) != crc32(cells):
                    return tile
        return None

    def _sweep(self) -> Tile | None:
        """Return the next tile that is not empty; None if none was found."""
        for _ in range(min(LOOKED_MAX, self._columns * self._rows)):
            row, column = divmod(self._swept, self._columns)
            self._swept = (self._swept + 1) % (self._columns * self._rows)
            if any(self._cells((column, row))):
                return column, row
        return None

    def _cells(self, tile: Tile) -> bytes:
        grid, column = self._grid, tile[0] * TILE_CELLS
        rows = range(tile[1] * TILE_CELLS, min((tile[1] + 1) * TILE_CELLS, grid.rows))
        width = min(TILE_CELLS, grid.columns - column)
        starts = (row * grid.columns + column for row in rows)
        return b"".join(grid.scores[start : start + width] for start in starts).translate(SHOWN)
