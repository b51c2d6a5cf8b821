"""Terrain: potholes, bumps and ditches of a scenario, and their conversion to patches of floor at another height.

The floor is flat at height 0. A patch lies lower or higher, with an upright edge all round. `wheel_contact.py`
computes its effect on wheels, `ground_sensor.py` its view from above. Where patches overlap the deepest counts, then
the highest.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, hypot, inf, sin, sqrt
from typing import Protocol

from msgspec import Struct

from lfa.protocol.config_file.mistake import Mistake, wrong

Point = tuple[float, float]
PATCH_WIDTH_M_MIN = 0.02
"""Minimum width [m] of a feature: two steps at 1 m/s, so that no edge lies between two steps of the simulation."""


class Pothole(Struct, frozen=True, forbid_unknown_fields=True):
    """Hole in the floor: round with diameter `width_m`, or rectangular if `length_m` is given too."""

    center_m: Point
    width_m: float
    """Extent [m] along `theta`."""
    depth_m: float
    length_m: float | None = None
    """Extent [m] across `theta`."""
    theta: float = 0.0


class Bump(Struct, frozen=True, forbid_unknown_fields=True):
    """Bar on the floor, like a speed bump, usually crossed along `theta`."""

    center_m: Point
    width_m: float
    """Extent [m] along `theta`."""
    length_m: float
    """Extent [m] across `theta`."""
    height_m: float
    theta: float = 0.0


class Ditch(Struct, frozen=True, forbid_unknown_fields=True):
    """Rectangular trench between two points."""

    ends_m: tuple[Point, Point]
    width_m: float
    depth_m: float


class Terrain(Protocol):
    """Terrain features of a world."""

    @property
    def potholes(self) -> tuple[Pothole, ...]: ...
    @property
    def bumps(self) -> tuple[Bump, ...]: ...
    @property
    def ditches(self) -> tuple[Ditch, ...]: ...


class Patch(Struct, frozen=True, gc=False):
    """Circle (`radius_m` above 0) or rectangle (x along `theta`) of floor at `height_m`, in `map`."""

    x: float
    y: float
    height_m: float
    radius_m: float = 0.0
    half_x_m: float = 0.0
    half_y_m: float = 0.0
    c: float = 1.0
    """cos(theta)"""
    s: float = 0.0
    """sin(theta)"""

    @property
    def reach_m(self) -> float:
        """Distance [m] of the patch's outermost point from its centre."""
        return self.radius_m or hypot(self.half_x_m, self.half_y_m)

    @property
    def corners_m(self) -> tuple[Point, ...]:
        """Corners [m] of a rectangle, in `map`, counter-clockwise."""
        a, b = self.half_x_m, self.half_y_m
        corners = ((a, -b), (a, b), (-a, b), (-a, -b))
        return tuple((self.x + self.c * u - self.s * v, self.y + self.s * u + self.c * v) for u, v in corners)

    def covers(self, x: float, y: float) -> bool:
        dx, dy = x - self.x, y - self.y
        if self.radius_m > 0.0:
            return dx * dx + dy * dy <= self.radius_m * self.radius_m
        return abs(self.c * dx + self.s * dy) <= self.half_x_m and abs(self.c * dy - self.s * dx) <= self.half_y_m

    def gap_m(self, x: float, y: float) -> float:
        """Return the distance [m] from (x, y) to the patch, zero on it."""
        dx, dy = x - self.x, y - self.y
        if self.radius_m > 0.0:
            return max(0.0, hypot(dx, dy) - self.radius_m)
        beside = max(0.0, abs(self.c * dx + self.s * dy) - self.half_x_m)
        return hypot(beside, max(0.0, abs(self.c * dy - self.s * dx) - self.half_y_m))

    def chord_m(self, x: float, y: float, ahead_x: float, ahead_y: float) -> float:
        """Return the length [m] in the patch of the line through (x, y) along the unit vector (ahead_x, ahead_y)."""
        dx, dy = x - self.x, y - self.y
        if self.radius_m > 0.0:
            beside = ahead_x * dy - ahead_y * dx
            return 2.0 * sqrt(max(0.0, self.radius_m * self.radius_m - beside * beside))
        enter, leave = -inf, inf
        along = (self.c * dx + self.s * dy, self.c * ahead_x + self.s * ahead_y, self.half_x_m)
        across = (self.c * dy - self.s * dx, self.c * ahead_y - self.s * ahead_x, self.half_y_m)
        for start, rate, half in (along, across):
            if abs(rate) > 1e-9:
                a, b = (-half - start) / rate, (half - start) / rate
                enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
            elif abs(start) > half:
                return 0.0
        return max(0.0, leave - enter)


Feature = Pothole | Bump | Ditch


def features(terrain: Terrain) -> Iterator[tuple[str, Feature]]:
    """Yield every feature with its key in the scenario, `potholes[0]` first."""
    kinds: tuple[tuple[str, tuple[Feature, ...]], ...] = (
        ("potholes", terrain.potholes),
        ("bumps", terrain.bumps),
        ("ditches", terrain.ditches),
    )
    for kind, several in kinds:
        for n, feature in enumerate(several):
            yield f"{kind}[{n}]", feature


def patches_of(terrain: Terrain) -> tuple[Patch, ...]:
    """Return all patches, in order of precedence where they overlap."""
    patches = (patch_of(feature) for _, feature in features(terrain))
    return tuple(sorted(patches, key=lambda patch: (patch.height_m > 0.0, -abs(patch.height_m))))


def patch_of(feature: Feature) -> Patch:
    """Convert `feature` to a patch of floor."""
    if isinstance(feature, Ditch):
        (x1, y1), (x2, y2) = feature.ends_m
        length_m = hypot(x2 - x1, y2 - y1)
        c, s = (y2 - y1) / length_m, (x1 - x2) / length_m
        half_x, half_y, height = 0.5 * feature.width_m, 0.5 * length_m, -feature.depth_m
        return Patch(0.5 * (x1 + x2), 0.5 * (y1 + y2), height, 0.0, half_x, half_y, c, s)
    (x, y), half_x, turned = feature.center_m, 0.5 * feature.width_m, (cos(feature.theta), sin(feature.theta))
    if isinstance(feature, Bump):
        return Patch(x, y, feature.height_m, 0.0, half_x, 0.5 * feature.length_m, *turned)
    if feature.length_m is None:
        return Patch(x, y, -feature.depth_m, half_x)
    return Patch(x, y, -feature.depth_m, 0.0, half_x, 0.5 * feature.length_m, *turned)


def feature_mistakes(where: str, feature: Feature) -> Iterator[Mistake]:
    """Yield the numbers of `feature` that are out of range; `where` is its key."""
    right = f"a number from {PATCH_WIDTH_M_MIN:g} to 1000"
    if not PATCH_WIDTH_M_MIN <= feature.width_m <= 1e3:
        yield wrong(f"{where}.width_m", feature.width_m, right)
    if isinstance(feature, Ditch):
        a, b = feature.ends_m
        if not PATCH_WIDTH_M_MIN <= hypot(b[0] - a[0], b[1] - a[1]) <= 1e3:
            yield wrong(f"{where}.ends_m", [list(a), list(b)], "two different points, at most 1000 m apart")
    elif feature.length_m is not None and not PATCH_WIDTH_M_MIN <= feature.length_m <= 1e3:
        yield wrong(f"{where}.length_m", feature.length_m, right)
    key, high = ("height_m", feature.height_m) if isinstance(feature, Bump) else ("depth_m", feature.depth_m)
    if not 0.001 <= high <= 10.0:
        yield wrong(f"{where}.{key}", high, "a number from 0.001 to 10")
