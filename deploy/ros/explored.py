"""Assembly of an exploring leader's map from its tiles, as one occupancy grid. Pure."""

from __future__ import annotations

from msgspec import Struct

from lfa.protocol.messages.team import PlanNote

CELLS_MAX = 4_000_000
"""Largest grid: 100 m x 100 m of cells of 5 cm. Tiles that would make it larger are dropped."""
TILES_MAX = 4096
CELL_M_MIN, CELL_M_MAX = 0.001, 10.0
UNKNOWN, FREE, OCCUPIED = b"\xff", b"\x00", b"\x64"
_VALUES = UNKNOWN + FREE + OCCUPIED * 254
"""Occupancy (-1, 0, 100 as int8) by the tile's cells: unknown, free, occupied."""


class MapCells(Struct, frozen=True):
    """Occupancy grid: size of a cell [m], lower left corner [m] in `map`, and int8 cells row by row from there."""

    cell_m: float
    corner: tuple[float, float]
    columns: int
    cells: bytes

    @property
    def rows(self) -> int:
        return len(self.cells) // self.columns


class _Tile(Struct, frozen=True):
    columns: int
    cells: bytes

    @property
    def rows(self) -> int:
        return len(self.cells) // self.columns


class ExploredMap:
    """Tiles of one leader; those of a new leader replace them."""

    def __init__(self) -> None:
        self._tiles: dict[tuple[int, int], _Tile] = {}
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
        tile = _Tile(note.columns, note.cells.translate(_VALUES))
        if self._tiles.get(corner) == tile:
            return
        tiles = {**self._tiles, corner: tile}
        if len(tiles) > TILES_MAX or _size(tiles) > CELLS_MAX:
            self.dropped += 1
            return
        self._tiles, self.changed = tiles, True

    def grid(self) -> MapCells | None:
        """Return the grid around all tiles; None without a tile."""
        self.changed = False
        if not self._tiles:
            return None
        left, low, right, high = _bounds(self._tiles)
        columns = right - left
        cells = bytearray(UNKNOWN * (columns * (high - low)))
        for (column, row), tile in self._tiles.items():
            for n in range(tile.rows):
                at = (row - low + n) * columns + column - left
                cells[at : at + tile.columns] = tile.cells[n * tile.columns : (n + 1) * tile.columns]
        return MapCells(self._cell_m, (left * self._cell_m, low * self._cell_m), columns, bytes(cells))


def _bounds(tiles: dict[tuple[int, int], _Tile]) -> tuple[int, int, int, int]:
    left, low = min(column for column, _ in tiles), min(row for _, row in tiles)
    right = max(column + tile.columns for (column, _), tile in tiles.items())
    return left, low, right, max(row + tile.rows for (_, row), tile in tiles.items())


def _size(tiles: dict[tuple[int, int], _Tile]) -> int:
    left, low, right, high = _bounds(tiles)
    return (right - left) * (high - low)
