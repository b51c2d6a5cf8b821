"""Reader of SVG drawings: closed shapes are obstacles, lines are walls; circles called start and goal say the way.

The y axis of a drawing points down, that of `map` up.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise
from math import atan2, ceil, cos, hypot, pi, radians, sin, sqrt, tan

from lfa.deploy.worlds.drawing import WorldDrawing, number, numbers
from lfa.deploy.worlds.xml_tree import Element
from lfa.protocol.errors import Refused
from lfa.world.description.scenario import Point

Matrix = tuple[float, float, float, float, float, float]
"""a, b, c, d, e, f of x' = a x + c y + e, y' = b x + d y + f."""

SAME: Matrix = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
ROUND_CORNERS, CURVE_STEPS = 24, 8
"""Corners of an ellipse, and lines of a curve."""
UNITS_M = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254}
UNIT_M = 0.01
"""Length [m] of a unit of a drawing that names no size in mm, cm, m or in."""
UNSEEN = ("defs", "symbol", "clipPath", "mask", "pattern", "marker", "metadata", "title", "desc", "style", "namedview")
GROUPS = ("svg", "g", "a")
ARGUMENTS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
FLAGS = (3, 4)
"""Places of the flags among the numbers of an arc: each is one digit, and the next number may follow it at once."""
_TOKEN = re.compile(r"([A-Za-z])|([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|[\s,]+|(.)", re.ASCII | re.DOTALL)
_FLAG = re.compile(r"[\s,]*()([01])()", re.ASCII)
_FUNCTION = re.compile(r"(\w+)\s*\(([^()]*)\)\s*,?\s*", re.ASCII)


def read_svg(root: Element, drawing: WorldDrawing, unit_m: float | None) -> None:
    """Add the shapes of a drawing, its unit `unit_m` [m] long; None: as its width says. Raises Refused."""
    if root.name != "svg":
        raise Refused(f"<{root.name[:40]}>: must be <svg>")
    scale = unit_m or _unit_of(root)
    _Reader(drawing).read(root, (scale, 0.0, 0.0, -scale, 0.0, 0.0))


def _unit_of(root: Element) -> float:
    """Return the length [m] of a unit by width and viewBox, where the width is in mm, cm, m or in."""
    match = re.fullmatch(r"\s*([\d.]+)\s*(mm|cm|m|in)\s*", root.attributes.get("width", ""), re.ASCII)
    box = numbers(root.attributes.get("viewBox", ""), "viewBox")
    if match is None or len(box) != 4 or box[2] <= 0.0:
        return UNIT_M
    return number(match[1], "width") * UNITS_M[match[2]] / box[2]


class _Reader:
    """Walk through a drawing's elements."""

    def __init__(self, drawing: WorldDrawing) -> None:
        self._drawing = drawing

    def read(self, element: Element, outer: Matrix) -> None:
        """Add an element and all in it, with the transform around it. Raises Refused."""
        matrix = _product(outer, _transform(element.attributes.get("transform", "")))
        if element.name in UNSEEN or element.attributes.get("display") == "none":
            return
        if element.name in GROUPS:
            for child in element.children:
                self.read(child, matrix)
            return
        where = f"<{element.name[:20]}> {element.attributes.get('id', '')[:40]}".strip()
        try:
            self._add(element, matrix, where)
        except Refused as refused:
            raise Refused(f"{where}: {refused}") from None

    def _add(self, element: Element, matrix: Matrix, where: str) -> None:
        if element.name == "circle" and element.attributes.get("id") in ("start", "goal"):
            setattr(self._drawing, element.attributes["id"], _at(matrix, *_center(element)))
            return
        match element.name:
            case "circle" if _is_even(matrix):
                self._drawing.add_circle(*_at(matrix, *_center(element)), _length(element, "r") * hypot(*matrix[:2]))
            case "rect":
                x, y, w, h = (_value(element, name) for name in ("x", "y", "width", "height"))
                if min(w, h) <= 0.0:
                    raise Refused(f"width, height = {w:g}, {h:g}: must be above 0")
                self._closed(matrix, [(x, y), (x + w, y), (x + w, y + h), (x, y + h)])
            case "circle" | "ellipse":
                (x, y), names = _center(element), ("r", "r") if element.name == "circle" else ("rx", "ry")
                a, b = (_length(element, name) for name in names)
                angles = [2.0 * pi * n / ROUND_CORNERS for n in range(ROUND_CORNERS)]
                self._closed(matrix, [(x + a * cos(angle), y + b * sin(angle)) for angle in angles])
            case "line":
                x1, y1, x2, y2 = (_value(element, name) for name in ("x1", "y1", "x2", "y2"))
                self._open(matrix, [(x1, y1), (x2, y2)])
            case "polyline":
                self._open(matrix, _pairs(element.attributes.get("points", "")))
            case "polygon":
                self._closed(matrix, _pairs(element.attributes.get("points", "")))
            case "path":
                for points, closed in _strokes(element.attributes.get("d", "")):
                    (self._closed if closed and len(points) > 2 else self._open)(matrix, points)
            case _:
                self._drawing.skipped.append(where)

    def _closed(self, matrix: Matrix, points: list[Point]) -> None:
        if len(points) < 3:
            raise Refused("must have at least three corners")
        self._drawing.add_polygon([_at(matrix, *point) for point in points])

    def _open(self, matrix: Matrix, points: list[Point]) -> None:
        self._drawing.add_line([_at(matrix, *point) for point in points])


# --- attributes -----------------------------------------------------------------------------------------------------


def _value(element: Element, name: str) -> float:
    """Return an attribute in units of the drawing, 0 without it; a trailing `px` is the same."""
    return number(element.attributes.get(name, "0").strip().removesuffix("px") or "0", name)


def _length(element: Element, name: str) -> float:
    value = _value(element, name)
    if value <= 0.0:
        raise Refused(f"{name} = {element.attributes.get(name, 'missing')[:20]}: must be a number above 0")
    return value


def _center(element: Element) -> Point:
    return _value(element, "cx"), _value(element, "cy")


def _pairs(text: str) -> list[Point]:
    values = numbers(text, "points")
    if len(values) % 2 or len(values) < 4:
        raise Refused(f"points: {len(values)} numbers, must be pairs of at least two points")
    return list(zip(values[::2], values[1::2], strict=True))


# --- transforms -----------------------------------------------------------------------------------------------------


def _transform(text: str) -> Matrix:
    """Return the matrix of a `transform` attribute. Raises Refused."""
    matrix, place = SAME, 0
    while place < len(text.strip()):
        match = _FUNCTION.match(text.strip(), place)
        if match is None:
            raise Refused(f"transform {text[:40]!r}: must be translate, scale, rotate, skewX, skewY or matrix")
        matrix, place = _product(matrix, _function(match[1], numbers(match[2], "transform"))), match.end()
    return matrix


def _function(name: str, v: list[float]) -> Matrix:
    match name, len(v):
        case "matrix", 6:
            return v[0], v[1], v[2], v[3], v[4], v[5]
        case "translate", 1 | 2:
            return 1.0, 0.0, 0.0, 1.0, v[0], v[1] if len(v) > 1 else 0.0
        case "scale", 1 | 2:
            return v[0], 0.0, 0.0, v[-1], 0.0, 0.0
        case "rotate", 1 | 3:
            c, s, (x, y) = cos(radians(v[0])), sin(radians(v[0])), v[1:] or (0.0, 0.0)
            return c, s, -s, c, x - c * x + s * y, y - s * x - c * y
        case "skewX", 1:
            return 1.0, 0.0, tan(radians(v[0])), 1.0, 0.0, 0.0
        case "skewY", 1:
            return 1.0, tan(radians(v[0])), 0.0, 1.0, 0.0, 0.0
    raise Refused(
        f"transform {name[:20]} of {len(v)} numbers: must be translate, scale, rotate, skewX, skewY or matrix"
    )


def _product(m: Matrix, n: Matrix) -> Matrix:
    (a, b, c, d, e, f), (g, h, i, j, k, o) = m, n
    return a * g + c * h, b * g + d * h, a * i + c * j, b * i + d * j, a * k + c * o + e, b * k + d * o + f


def _at(m: Matrix, x: float, y: float) -> Point:
    return m[0] * x + m[2] * y + m[4], m[1] * x + m[3] * y + m[5]


def _is_even(m: Matrix) -> bool:
    """Return True if a circle stays a circle."""
    one, other = hypot(m[0], m[1]), hypot(m[2], m[3])
    return abs(one - other) <= 1e-6 * max(one, other) and abs(m[0] * m[2] + m[1] * m[3]) <= 1e-9 * max(one, other, 1.0)


# --- paths ----------------------------------------------------------------------------------------------------------


def _strokes(text: str) -> Iterator[tuple[list[Point], bool]]:
    """Yield the points of each part of a path, and whether it is closed. Raises Refused."""
    points: list[Point] = []
    handle: Point | None = None
    for letter, v in _commands(text):
        kind, relative = letter.upper(), letter.islower()
        if kind == "M":
            if len(points) > 1:
                yield points, False
            x, y = points[-1] if points and relative else (0.0, 0.0)
            points, handle = [(x + v[0], y + v[1])], None
            continue
        if not points:
            raise Refused(f"d: {letter} before the first M")
        if kind == "Z":
            yield points, True
            points, handle = [points[0]], None
            continue
        last = points[-1]
        if kind == "A":
            points, handle = [*points, *_arc(last, v, relative)], None
            continue
        ends = _ends(kind, v, last, relative)
        curve = _controls(kind, ends, last, handle)
        handle = curve[-2] if len(curve) > 1 else None
        points += [curve[-1]] if len(curve) == 1 else [_bezier([last, *curve], n) for n in range(1, CURVE_STEPS + 1)]
    if len(points) > 1:
        yield points, False


def _commands(text: str) -> Iterator[tuple[str, list[float]]]:
    """Yield each command's letter and numbers; numbers without a letter repeat the command before."""
    letter, values = "", [0.0][:0]
    place = 0
    while place < len(text):
        is_flag = letter in ("A", "a") and len(values) in FLAGS
        match = (_FLAG.match(text, place) if is_flag else None) or _TOKEN.match(text, place)
        assert match is not None, "any character is a token"
        if is_flag and match[2] not in ("0", "1", None):
            raise Refused(f"d: {letter} with the flag {match[2][:20]}: must be 0 or 1")
        place = match.end()
        if match[3]:
            raise Refused(f"d: {match[3]!r}: must be commands and numbers")
        if match[1]:
            if values:
                raise Refused(f"d: {letter} with {len(values)} numbers too many or too few")
            letter = match[1]
            if letter.upper() not in ARGUMENTS:
                raise Refused(f"d: command {letter}: must be one of {' '.join(ARGUMENTS)}")
        elif match[2]:
            values.append(number(match[2], "d"))
        wanted = ARGUMENTS.get(letter.upper(), 1)
        if (wanted == 0 and match[1]) or (wanted > 0 and len(values) == wanted):
            yield letter, values
            values = []
            letter = {"M": "L", "m": "l"}.get(letter, letter)
    if values:
        raise Refused(f"d: {letter or 'numbers'} with {len(values)} numbers too many or too few")


def _ends(kind: str, v: list[float], last: Point, relative: bool) -> list[Point]:
    """Return the points that a command names."""
    x, y = last if relative else (0.0, 0.0)
    if kind == "H":
        return [(x + v[0], last[1])]
    if kind == "V":
        return [(last[0], y + v[0])]
    return [(x + a, y + b) for a, b in zip(v[::2], v[1::2], strict=True)]


def _arc(last: Point, v: list[float], relative: bool) -> list[Point]:
    """Return the points of an elliptical arc from `last` on; by the notes on implementation of SVG, F.6.5 and F.6.6."""
    (ax, ay), (rx, ry), turn = last, (abs(v[0]), abs(v[1])), radians(v[2])
    large, sweep = v[3] != 0.0, v[4] != 0.0
    bx, by = (ax + v[5], ay + v[6]) if relative else (v[5], v[6])
    if min(rx, ry) == 0.0 or (ax, ay) == (bx, by):
        return [(bx, by)]
    c, s = cos(turn), sin(turn)
    x, y = (c * (ax - bx) + s * (ay - by)) / 2.0 / rx, (c * (ay - by) - s * (ax - bx)) / 2.0 / ry
    half = hypot(x, y)
    if half > 1.0:  # radii that do not reach grow until they do
        rx, ry, x, y, half = rx * half, ry * half, x / half, y / half, 1.0
    apart = sqrt(max(0.0, 1.0 - half * half)) / half * (-1.0 if large == sweep else 1.0)
    ux, uy = apart * y, -apart * x
    begin, end = atan2(y - uy, x - ux), atan2(-y - uy, -x - ux)
    span = (end - begin) % (2.0 * pi) if sweep else -((begin - end) % (2.0 * pi))
    steps = max(1, ceil(abs(span) / (2.0 * pi) * ROUND_CORNERS))
    points = []
    for n in range(1, steps):
        angle = begin + span * n / steps
        px, py = rx * (ux + cos(angle)), ry * (uy + sin(angle))
        points.append((c * px - s * py + (ax + bx) / 2.0, s * px + c * py + (ay + by) / 2.0))
    return [*points, (bx, by)]


def _controls(kind: str, ends: list[Point], last: Point, handle: Point | None) -> list[Point]:
    """Return handles and end of a curve; those of S and T begin with the mirrored handle of the curve before."""
    if kind not in ("S", "T"):
        return ends
    hx, hy = handle or last
    return [(2.0 * last[0] - hx, 2.0 * last[1] - hy), *ends]


def _bezier(points: list[Point], step: int) -> Point:
    t = step / CURVE_STEPS
    while len(points) > 1:
        points = [((1.0 - t) * ax + t * bx, (1.0 - t) * ay + t * by) for (ax, ay), (bx, by) in pairwise(points)]
    return points[0]
