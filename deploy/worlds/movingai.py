"""Reader of MovingAI grid maps (`.map`): https://movingai.com/benchmarks/formats.html."""

from __future__ import annotations

import numpy as np

from lfa.deploy.worlds.drawing import WorldDrawing
from lfa.protocol.errors import Refused
from lfa.world.description import maps
from lfa.world.description.maps import Map

FREE, BLOCKED = ".GS", "@OTW"
"""Letters of cells: passable, and out of bounds, trees and water. Swamp counts as passable."""
SIDE_MAX = 4096
HEADER = ("type", "height", "width", "map")


def read_movingai(text: str, drawing: WorldDrawing, unit_m: float) -> None:
    """Add the outlines of the blocked cells, `unit_m` [m] wide each. Raises Refused."""
    lines = text.splitlines()
    sizes: dict[str, int] = {}
    for number, (line, key) in enumerate(zip([*lines[:4], *[""] * 4], HEADER, strict=False), start=1):
        word, _, value = line.strip().partition(" ")
        if word != key:
            raise Refused(f"line {number}: {line[:40]!r}: must be `{key}`, as in a MovingAI map")
        if key in ("height", "width"):
            sizes[key] = _side(key, value)
    rows = lines[4 : 4 + sizes["height"]]
    if len(rows) != sizes["height"]:
        raise Refused(f"height {sizes['height']}: the file has {len(rows)} rows of cells")
    for number, row in enumerate(rows, start=5):
        strange = next((letter for letter in row if letter not in FREE + BLOCKED), None)
        if len(row) != sizes["width"] or strange is not None:
            what = f"{len(row)} cells" if strange is None else f"cell {strange!r}"
            raise Refused(f"line {number}: {what}: must be {sizes['width']} of {' '.join(FREE + BLOCKED)}")
    blocked = np.array([[letter in BLOCKED for letter in row] for row in rows[::-1]], dtype=bool)
    add_cells(Map(np.where(blocked, maps.OCCUPIED, 0).astype(np.int16), unit_m), drawing)


def add_cells(drawn: Map, drawing: WorldDrawing) -> None:
    """Add the outlines of the occupied cells of a grid, and its border as a wall. Raises Refused."""
    rows, columns = drawn.cells.shape
    high, wide = rows * drawn.resolution_m, columns * drawn.resolution_m
    rim = [drawn.to_map(x, y) for x, y in ((0.0, 0.0), (wide, 0.0), (wide, high), (0.0, high), (0.0, 0.0))]
    xs, ys = [x for x, _ in rim], [y for _, y in rim]
    drawing.bounds_m = min(xs), min(ys), max(xs), max(ys)
    for x1, y1, x2, y2 in maps.walls(drawn):
        drawing.add_line([(x1, y1), (x2, y2)])
    if not bool(np.all(drawn.occupied[[0, -1], :])) or not bool(np.all(drawn.occupied[:, [0, -1]])):
        drawing.add_line(rim)


def _side(key: str, text: str) -> int:
    if not (text.isascii() and text.isdigit() and 1 <= int(text[:9]) <= SIDE_MAX):
        raise Refused(f"{key} {text[:20]!r}: must be a whole number from 1 to {SIDE_MAX}")
    return int(text)
