"""World as a reader found it in a file: walls, obstacles, where a team starts and where it is to go. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, hypot, isfinite, pi, sin
from pathlib import Path

from msgspec import Struct, field

from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import FILE_BYTES_MAX, DamagedFile, read_bytes
from lfa.world.description.maps import Segment
from lfa.world.description.scenario import PLACE_M_MAX, Obstacle, Point

SIZE_M_MIN, SIZE_M_MAX = 0.01, 100.0
"""Radius [m] of a round obstacle that a scenario may have."""
SHAPES_MAX = 20_000
"""Largest number of walls and obstacles together: the simulated scanners look at all of them."""
SAME_M = 1e-6


class WorldDrawing(Struct):
    """Walls, obstacles, start and goal, in metres in `map`."""

    name: str
    walls: list[Segment] = field(default_factory=list)
    obstacles: list[Obstacle] = field(default_factory=list)
    start: Point | None = None
    goal: Point | None = None
    robots: int | None = None
    """Number of robots in the file; None: it has none."""
    radius_m: float | None = None
    """Radius [m] of its robots."""
    bounds_m: tuple[float, float, float, float] | None = None
    """Box x1, y1, x2, y2 [m] of a grid of cells, beyond which there is nothing; None: a world goes on around it."""
    skipped: list[str] = field(default_factory=list)
    """What a scenario cannot hold, a few words each."""

    def add_line(self, points: Sequence[Point]) -> None:
        """Add walls along a line. Raises Refused for places that no scenario has."""
        for (x1, y1), (x2, y2) in pairwise(points):
            if hypot(x2 - x1, y2 - y1) > SAME_M:
                self._count()
                self.walls.append((*self._place(x1, y1), *self._place(x2, y2)))

    def add_circle(self, x: float, y: float, radius_m: float) -> None:
        """Add a round obstacle; a dot that no scenario can hold is left out. Raises Refused."""
        if 0.0 < radius_m < SIZE_M_MIN:
            self.skipped.append(f"circle of radius {radius_m:g} m at {x:g}, {y:g}")
            return
        if not SIZE_M_MIN <= radius_m <= SIZE_M_MAX:
            raise Refused(f"radius {radius_m:g} m: must be from {SIZE_M_MIN:g} to {SIZE_M_MAX:g}")
        self._count()
        self.obstacles.append(Obstacle(self._place(x, y), round(radius_m, 6)))

    def add_polygon(self, points: Sequence[Point]) -> None:
        """Add an obstacle; one that is not convex becomes walls along its outline. Raises Refused."""
        ring = [a for a, b in pairwise([*points, points[0]]) if hypot(a[0] - b[0], a[1] - b[1]) > SAME_M]
        ring = [b for a, b, c in zip(ring[-1:] + ring[:-1], ring, ring[1:] + ring[:1], strict=True) if _bends(a, b, c)]
        if len(ring) < 3:
            self.add_line(points)
            return
        if _area(ring) < 0.0:
            ring.reverse()
        if not is_convex(ring):
            self.add_line([*ring, ring[0]])
            return
        self._count()
        x, y = sum(x for x, _ in ring) / len(ring), sum(y for _, y in ring) / len(ring)
        corners = tuple((round(cx - x, 6), round(cy - y, 6)) for cx, cy in ring)
        self.obstacles.append(Obstacle(self._place(x, y), corners_m=corners))

    def add_box(self, x: float, y: float, theta: float, size: tuple[float, float]) -> None:
        """Add a rectangle of `size` [m] around x, y, turned by `theta` [rad]. Raises Refused."""
        c, s, (a, b) = cos(theta), sin(theta), (0.5 * size[0], 0.5 * size[1])
        if not (min(size) > 0.0 and max(size) <= PLACE_M_MAX):
            raise Refused(f"size {size[0]:g} x {size[1]:g} m: must be above 0 and at most {PLACE_M_MAX:g}")
        corners = ((a, -b), (a, b), (-a, b), (-a, -b))
        self.add_polygon([(x + c * u - s * v, y + s * u + c * v) for u, v in corners])

    def _count(self) -> None:
        if len(self.walls) + len(self.obstacles) >= SHAPES_MAX:
            raise Refused(f"more than {SHAPES_MAX} walls and obstacles: must be fewer, a scanner looks at all of them")

    def _place(self, x: float, y: float) -> Point:
        if not (isfinite(x) and isfinite(y) and max(abs(x), abs(y)) <= PLACE_M_MAX):
            raise Refused(f"place ({x:g}, {y:g}): must be within {PLACE_M_MAX:g} m")
        return round(x, 6), round(y, 6)


def is_convex(ring: Sequence[Point]) -> bool:
    """Return True if each corner of a counter-clockwise ring turns left, once around in all."""
    turned = 0.0
    for (ax, ay), (bx, by), (cx, cy) in zip(ring, (*ring[1:], ring[0]), (*ring[2:], *ring[:2]), strict=True):
        turn = atan2((bx - ax) * (cy - by) - (by - ay) * (cx - bx), (bx - ax) * (cx - bx) + (by - ay) * (cy - by))
        if turn <= 1e-9:
            return False
        turned += turn
    return abs(turned - 2.0 * pi) < 1e-6


def number(text: object, what: str) -> float:
    """Return a finite number of at most `PLACE_M_MAX` in size. Raises Refused that names `what` it is."""
    try:
        value = float(str(text))
    except ValueError:
        value = float("nan")
    if isinstance(text, bool) or not abs(value) <= PLACE_M_MAX:
        raise Refused(f"{what} = {str(text)[:40]}: must be a number up to {PLACE_M_MAX:g}")
    return value


def numbers(text: str, what: str) -> list[float]:
    """Return the numbers in a text, separated by blanks or commas. Raises Refused."""
    return [number(word, what) for word in text.replace(",", " ").split()]


def text_of(path: Path) -> str:
    """Return the text of a file of at most `FILE_BYTES_MAX` bytes. Raises Refused."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise Refused(f"{path}: no text in UTF-8") from None
    except (OSError, DamagedFile) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise Refused(f"{path}: cannot be read ({why}), must be a file of at most {FILE_BYTES_MAX} bytes") from None


def _bends(a: Point, b: Point, c: Point) -> bool:
    """Return False for a corner on the straight line between its neighbours."""
    cross = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
    return abs(cross) > 1e-9 * hypot(b[0] - a[0], b[1] - a[1]) * hypot(c[0] - b[0], c[1] - b[1])


def _area(ring: Sequence[Point]) -> float:
    return 0.5 * sum(ax * by - bx * ay for (ax, ay), (bx, by) in pairwise([*ring, ring[0]]))
