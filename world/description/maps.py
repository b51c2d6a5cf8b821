"""Reading and writing of ROS occupancy maps (`map.yaml` and its pgm or png), and their geometry in metres.

Cells are read as Nav2's map server reads them: p = 1 - shade/255 (shade/255 with `negate`), occupied above
`occupied_thresh`, free below `free_thresh`. Row 0 of the image is the top, `origin` the lower left corner and its yaw.
In memory row 0 is the bottom, so that cell (row, column) lies at (column, row) times the resolution.
"""

from __future__ import annotations

import re
from math import cos, isfinite, sin
from pathlib import Path

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import open_binary
from lfa.world.description.images import Shades, shades_of

UNKNOWN = -1
OCCUPIED = 100
YAML_BYTES_MAX = 64 * 1024
MODES = ("trinary", "scale", "raw")

Cells = npt.NDArray[np.int16]
Segment = tuple[float, float, float, float]
Point = tuple[float, float]


class Map(Struct, frozen=True):
    """Occupancy grid in percent (0 free, 100 occupied, -1 unknown) of square cells; row 0 is the bottom."""

    cells: Cells
    resolution_m: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose [m, m, rad] of the lower left corner in `map`."""
    occupied_thresh: float = 0.65

    @property
    def occupied(self) -> npt.NDArray[np.bool_]:
        return self.cells >= 100.0 * self.occupied_thresh

    def cell_of(self, x: float, y: float) -> tuple[int, int] | None:
        """Return row and column of a point in `map`; None outside of the image."""
        c, s = cos(self.origin[2]), sin(self.origin[2])
        dx, dy = x - self.origin[0], y - self.origin[1]
        column = int((c * dx + s * dy) // self.resolution_m)
        row = int((c * dy - s * dx) // self.resolution_m)
        inside = 0 <= row < self.cells.shape[0] and 0 <= column < self.cells.shape[1]
        return (row, column) if inside else None

    def to_map(self, x: float, y: float) -> Point:
        """Transform a point from the image's axes ([m] from its lower left corner) to `map`."""
        c, s = cos(self.origin[2]), sin(self.origin[2])
        return self.origin[0] + c * x - s * y, self.origin[1] + s * x + c * y


def read(path: Path) -> Map:
    """Read the map of a `map.yaml`. Raises Refused with one line: file, key, value, what would be valid."""
    fields = _fields(path)
    image = fields.get("image")
    if not image:
        raise Refused(f"{path}: image is missing: must name a pgm or png file")
    resolution_m = _number(path, fields, "resolution", None)
    if not 1e-4 <= resolution_m <= 100.0:
        raise Refused(f"{path}: resolution = {resolution_m:g}: must be from 0.0001 to 100 m a cell")
    occupied_thresh = _number(path, fields, "occupied_thresh", 0.65)
    free_thresh = _number(path, fields, "free_thresh", 0.25)
    if not 0.0 <= free_thresh <= occupied_thresh <= 1.0:
        value = f"{free_thresh:g}, occupied_thresh = {occupied_thresh:g}"
        raise Refused(f"{path}: free_thresh = {value}: must be 0 <= free <= occupied <= 1")
    mode = fields.get("mode", "trinary")
    if mode not in MODES:
        raise Refused(f"{path}: mode = {mode}: must be one of {', '.join(MODES)}")
    negate = fields.get("negate", "0").lower()
    if negate not in ("0", "1", "true", "false"):
        raise Refused(f"{path}: negate = {negate}: must be 0 or 1")
    shades, opaque = shades_of(path, image)
    cells = _occupancy(shades, mode, negate in ("1", "true"), free_thresh, occupied_thresh)
    if opaque is not None:
        cells[~opaque] = UNKNOWN
    return Map(cells[::-1].copy(), resolution_m, _origin(path, fields), occupied_thresh)


def write(path: Path, drawn: Map) -> None:
    """Write `path` (a .yaml) and the .pgm beside it, trinary: 0 occupied, 254 free, 205 unknown."""
    image = path.with_suffix(".pgm")
    shades = np.full(drawn.cells.shape, 254, dtype=np.uint8)
    shades[drawn.cells == UNKNOWN] = 205
    shades[drawn.occupied] = 0
    rows, columns = drawn.cells.shape
    x, y, yaw = drawn.origin
    image.write_bytes(b"P5\n%d %d\n255\n" % (columns, rows) + shades[::-1].tobytes())
    path.write_text(
        f"image: {image.name}\nmode: trinary\nresolution: {drawn.resolution_m:g}\n"
        f"origin: [{x:.6f}, {y:.6f}, {yaw:.6f}]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def walls(drawn: Map) -> tuple[Segment, ...]:
    """Return the outlines of occupied cells as segments in `map`, one for each straight run of cell edges."""
    padded = np.pad(drawn.occupied, 1).astype(np.int8)
    found: list[Segment] = []
    for row, low, high in _runs(np.diff(padded, axis=0)[:, 1:-1]):
        found.append((low, row, high, row))
    for column, low, high in _runs(np.diff(padded, axis=1)[1:-1].T):
        found.append((column, low, column, high))
    r = drawn.resolution_m
    return tuple(
        (*_rounded(drawn.to_map(r * x1, r * y1)), *_rounded(drawn.to_map(r * x2, r * y2))) for x1, y1, x2, y2 in found
    )


def boxes(drawn: Map) -> tuple[Segment, ...]:
    """Return the occupied cells of a mask with yaw 0 as boxes x1, y1, x2, y2 in `map`, merging equal runs of rows."""
    r = drawn.resolution_m
    open_runs: dict[tuple[int, int], int] = {}
    found: list[tuple[int, int, int, int]] = []
    rows = [*drawn.occupied.astype(np.int8), np.zeros(drawn.cells.shape[1], dtype=np.int8)]
    for row, line in enumerate(rows):
        runs = {(low, high) for _, low, high in _runs(line[None, :])}
        for run in sorted(open_runs.keys() - runs):
            found.append((*run, open_runs.pop(run), row))
        for run in sorted(runs - open_runs.keys()):
            open_runs[run] = row
    return tuple(
        (*_rounded(drawn.to_map(r * x1, r * y1)), *_rounded(drawn.to_map(r * x2, r * y2))) for x1, x2, y1, y2 in found
    )


class Room:
    """Distance field of a map's walls: clearance of any point."""

    def __init__(self, drawn: Map) -> None:
        self._drawn = drawn
        self._rows, self._columns = np.nonzero(drawn.occupied)

    def clearance_m(self, x: float, y: float) -> float:
        """Return the distance [m] to the edge of the nearest occupied cell; 0 inside of one, inf with no walls."""
        if not len(self._rows):
            return float("inf")
        drawn, half = self._drawn, 0.5
        c, s = cos(drawn.origin[2]), sin(drawn.origin[2])
        dx, dy = (x - drawn.origin[0]) / drawn.resolution_m, (y - drawn.origin[1]) / drawn.resolution_m
        away_x = np.maximum(np.abs(self._columns + half - (c * dx + s * dy)) - half, 0.0)
        away_y = np.maximum(np.abs(self._rows + half - (c * dy - s * dx)) - half, 0.0)
        return drawn.resolution_m * float(np.sqrt(np.min(away_x * away_x + away_y * away_y)))


def _rounded(point: Point) -> Point:
    return round(point[0], 6), round(point[1], 6)


def _runs(edges: npt.NDArray[np.int8]) -> list[tuple[int, int, int]]:
    """Return line, first and last+1 index of each run of equal non-zero values along the lines of `edges`."""
    padded = np.pad(edges, ((0, 0), (1, 1)))
    lines, places = np.nonzero(np.diff(padded, axis=1))
    found = []
    for n in range(len(lines) - 1):
        line, low, high = int(lines[n]), int(places[n]), int(places[n + 1])
        if lines[n + 1] == line and edges[line, low] != 0:
            found.append((line, low, high))
    return found


def _fields(path: Path) -> dict[str, str]:
    """Parse the flat `key: value` lines of a map.yaml, the subset of YAML that ROS writes. Raises Refused."""
    try:
        with open_binary(path) as file:
            text = file.read(YAML_BYTES_MAX + 1).decode("utf-8-sig")
    except OSError as error:
        raise Refused(f"{path}: cannot be read ({error.strerror or error}): must be a map.yaml") from None
    except UnicodeDecodeError:
        raise Refused(f"{path}: no text: must be a map.yaml") from None
    except ValueError as error:  # a null byte in the path
        raise Refused(f"{str(path)!r}: cannot be read ({error}): must be a map.yaml") from None
    if len(text) > YAML_BYTES_MAX:
        raise Refused(f"{path}: longer than {YAML_BYTES_MAX} bytes: must be a map.yaml")
    fields: dict[str, str] = {}
    for number, line in enumerate(re.sub(r"\n[ \t]*-[ \t]+", r" - ", text).splitlines(), start=1):
        stripped = re.sub(r"(^|\s)#.*$", "", line).strip()
        if not stripped or stripped in ("---", "..."):
            continue
        match = re.fullmatch(r"(\w+)\s*:\s*(.*)", stripped)
        if match is None:
            raise Refused(f"{path} line {number}: {stripped[:40]!r}: must be `key: value` as in a ROS map.yaml")
        fields[match[1]] = match[2].strip().strip("'\"")
    return fields


def _number(path: Path, fields: dict[str, str], key: str, default: float | None) -> float:
    text = fields.get(key)
    if text is None and default is not None:
        return default
    if text is None:
        raise Refused(f"{path}: {key} is missing: must be given")
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise Refused(f"{path}: {key} = {text}: must be a number")
    return value


def _origin(path: Path, fields: dict[str, str]) -> tuple[float, float, float]:
    """Parse `[x, y, yaw]` [m, m, rad], also written as a YAML list of lines. Raises Refused."""
    text = fields.get("origin", "[0, 0, 0]")
    try:
        values = [
            float(part) for part in re.split(r"[,\s]+|(?:^|\s)-\s", text.strip("[] ")) if part not in (None, "", "-")
        ]
    except ValueError:
        values = []
    if len(values) not in (2, 3) or not all(isfinite(value) for value in values):
        raise Refused(f"{path}: origin = {text}: must be [x, y, yaw] in metres and radians")
    return values[0], values[1], values[2] if len(values) == 3 else 0.0


def _occupancy(shades: Shades, mode: str, negate: bool, free: float, occupied: float) -> Cells:
    if mode == "raw":
        raw = shades.astype(np.int16)
        return np.where(raw <= OCCUPIED, raw, UNKNOWN).astype(np.int16)
    p = shades / 255.0 if negate else 1.0 - shades / 255.0
    between = np.full(shades.shape, UNKNOWN, dtype=np.int16)
    if mode == "scale" and occupied > free:
        between = np.clip(np.rint(100.0 * (p - free) / (occupied - free)), 0, 99).astype(np.int16)
        between = np.minimum(between, np.int16(100.0 * occupied - 0.5))
    return np.where(p > occupied, OCCUPIED, np.where(p < free, 0, between)).astype(np.int16)
