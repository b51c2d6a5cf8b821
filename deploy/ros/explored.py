"""Assembly of an exploring leader's map from its tiles, as one occupancy grid. Pure."""

from __future__ import annotations

from typing import Any

import numpy as np

from lfa.protocol.messages.team import PlanNote

CELLS_MAX = 4_000_000
"""Largest grid: 100 m x 100 m of cells of 5 cm. Tiles that would make it larger are dropped."""
TILES_MAX = 4096
CELL_M_MIN, CELL_M_MAX = 0.001, 10.0
_VALUES = np.array([-1, 0, 100], dtype=np.int8)
"""Occupancy by the tile's cells: unknown, free, occupied."""


class ExploredMap:
    """Tiles of one leader; those of a new leader replace them."""

    def __init__(self) -> None:
        self._tiles: dict[tuple[int, int], Any] = {}
        self._planner = ""
        self._cell_m = 0.0
        self.changed = False
        self.dropped = 0

    def update(self, note: PlanNote) -> None:
        """Add the tile of `note`; a tile that does not fit is dropped and counted."""
        if (note.header.sender, note.cell_m) != (self._planner, self._cell_m):
            self._tiles.clear()
            self._planner, self._cell_m = note.header.sender, note.cell_m
        if not note.cells:
            return
        if not CELL_M_MIN <= note.cell_m <= CELL_M_MAX:
            self.dropped += 1
            return
        corner = round(note.corner_map[0] / note.cell_m), round(note.corner_map[1] / note.cell_m)
        cells = np.frombuffer(note.cells, dtype=np.uint8).reshape(-1, note.columns)
        tile = _VALUES[np.minimum(cells, 2)]
        before = self._tiles.get(corner)
        if before is not None and np.array_equal(before, tile):
            return
        tiles = {**self._tiles, corner: tile}
        if len(tiles) > TILES_MAX or _size(tiles) > CELLS_MAX:
            self.dropped += 1
            return
        self._tiles, self.changed = tiles, True

    def grid(self) -> tuple[float, tuple[float, float], Any] | None:
        """Return cell size [m], lower left corner [m] in `map` and int8 cells by row; None without a tile."""
        self.changed = False
        if not self._tiles:
            return None
        left, low, right, high = _bounds(self._tiles)
        cells = np.full((high - low, right - left), -1, dtype=np.int8)
        for (column, row), tile in self._tiles.items():
            cells[row - low : row - low + tile.shape[0], column - left : column - left + tile.shape[1]] = tile
        return self._cell_m, (left * self._cell_m, low * self._cell_m), cells


def _bounds(tiles: dict[tuple[int, int], Any]) -> tuple[int, int, int, int]:
    left, low = min(column for column, _ in tiles), min(row for _, row in tiles)
    right = max(column + tile.shape[1] for (column, _), tile in tiles.items())
    return left, low, right, max(row + tile.shape[0] for (_, row), tile in tiles.items())


def _size(tiles: dict[tuple[int, int], Any]) -> int:
    left, low, right, high = _bounds(tiles)
    return (right - left) * (high - low)
