"""Conversion of a ROS scan to a scan in `base_link`: mount, direction of rotation, bad readings. Pure."""

from __future__ import annotations

from math import atan2, cos, hypot, inf, isfinite, isnan, nan, pi, sin
from typing import Any

from lfa.deploy.robot.base import Scan
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import TAU, Pose2D

BEAMS_MAX = 720
"""Largest number of beams passed on; of neighbours that share a beam the nearest reading counts."""
_UNUSUAL = {
    "nan": "such beams count as not measured",
    "zero": "such beams count as not measured",
    "-inf": "something nearer than range_min counts there (REP-117)",
}
STEP_RAD_MIN = 1e-6
"""Least angle [rad] between two beams; a turn of the finest scanners has a hundred thousand."""
CENTRED_M = 1e-3
"""Distance [m] of the scanner from the base's centre below which beams keep their ranges."""


def converted(message: Any, mount: Pose2D) -> Scan:
    """Return a sensor_msgs/LaserScan, taken by a scanner at `mount` in the base frame, as a scan of the base.

    Zero and nan are bad beams (nan), readings below and above the range are -inf and +inf (REP-117). A scanner that
    turns clockwise has a negative increment. Raises Refused when the message describes no scan.
    """
    step, count = float(message.angle_increment), len(message.ranges)
    low, high, first = float(message.range_min), float(message.range_max), float(message.angle_min)
    angles = STEP_RAD_MIN <= abs(step) <= TAU and abs(first) <= 2.0 * TAU
    if not count or not angles or not (0.0 <= low < high and isfinite(high)):
        raise Refused(
            f"{count} beams from {first:g} rad by {step:g} rad, {low:g} to {high:g} m: must be finite, above 0, angles "
            "of a turn at most"
        )
    ranges = [_reading(float(value), low, high) for value in message.ranges]
    if step < 0.0:
        first, step, ranges = first + step * (count - 1), -step, ranges[::-1]
    first += mount.theta
    if hypot(mount.x, mount.y) > CENTRED_M or count > BEAMS_MAX:
        first, step, ranges = _rebinned(first, step, ranges, mount)
        high += hypot(mount.x, mount.y)
    return Scan(_wrapped(first), step, low, high, tuple(ranges))


def remarks(message: Any) -> dict[str, str]:
    """Return what is unusual in a scan, a line each by its kind; `converted` takes all of it as the line says."""
    found = {}
    if message.angle_increment < 0.0:
        found["clockwise"] = "the scan has a negative angle_increment: its beams are taken in reverse"
    counts = {
        "nan": sum(map(isnan, message.ranges)),
        "zero": sum(value == 0.0 for value in message.ranges),
        "-inf": sum(value == -inf for value in message.ranges),
    }
    for kind, means in _UNUSUAL.items():
        if counts[kind]:
            found[kind] = f"{counts[kind]} of {len(message.ranges)} ranges of a scan are {kind}: {means}"
    return found


def _reading(value: float, low: float, high: float) -> float:
    if isnan(value) or value == 0.0:
        return nan
    if value < low:
        return -inf
    return inf if value > high else value


def _rebinned(first: float, step: float, ranges: list[float], mount: Pose2D) -> tuple[float, float, list[float]]:
    """Return first angle, step and ranges as seen from the base: each point moved, the nearest per beam kept."""
    count = min(len(ranges), BEAMS_MAX)
    span = min(step * len(ranges), TAU)
    whole = span > TAU - 2.0 * step
    start, width = (-pi, TAU) if whole else (first, span)
    wide = width / count
    beams = [nan] * count
    for n, reading in enumerate(ranges):
        angle = first + n * step
        seen, bearing = reading, angle
        if isfinite(reading):
            x, y = mount.x + reading * cos(angle), mount.y + reading * sin(angle)
            seen, bearing = hypot(x, y), atan2(y, x)
        place = int(((bearing - start) % TAU) / wide + 0.5)
        place = place % count if whole else place
        if 0 <= place < count and _nearer(seen, beams[place]):
            beams[place] = seen
    return start, wide, beams


def _nearer(reading: float, than: float) -> bool:
    return not isnan(reading) and (isnan(than) or reading < than)


def _wrapped(angle: float) -> float:
    """Return an angle's equivalent in [-pi, pi)."""
    return (angle + pi) % TAU - pi
