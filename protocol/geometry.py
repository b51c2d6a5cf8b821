"""Geometry in SE(2): poses, twists and exact motion along arcs. SI units, radians, counter-clockwise (REP-103)."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin
from typing import Annotated

from msgspec import Meta, Struct

TAU = 2.0 * pi
Point = tuple[float, float]
NUMBER_MAX = 1e9
Number = Annotated[float, Meta(ge=-NUMBER_MAX, le=NUMBER_MAX)]
"""Number that a core computes with, bounded by NUMBER_MAX: decoding rejects larger ones, so that sums stay finite."""


class Pose2D(Struct, frozen=True, array_like=True, gc=False):
    """Position [m] and yaw [rad] of one frame in another; the variable's name contains the frame."""

    x: Number = 0.0
    y: Number = 0.0
    theta: Number = 0.0


class Twist(Struct, frozen=True, array_like=True, gc=False):
    """Velocity of `base_link`, expressed in `base_link`: forward [m/s] and yaw rate [rad/s]."""

    linear_x: Number = 0.0
    angular_z: Number = 0.0


STILL = Twist(0.0, 0.0)


def slowed(twist: Twist, speed_max_mps: float) -> Twist:
    """Return `twist` scaled down to `speed_max_mps` [m/s], with v/omega kept."""
    share = speed_max_mps / max(abs(twist.linear_x), 1e-9)
    return twist if share >= 1.0 else Twist(share * twist.linear_x, share * twist.angular_z)


def wrap(angle: float) -> float:
    """Return `angle` [rad] wrapped into (-pi, pi]."""
    wrapped = (angle + pi) % TAU - pi
    return pi if wrapped == -pi else wrapped


def compose(a_b: Pose2D, b_c: Pose2D) -> Pose2D:
    """Return the pose of c in a, from b in a and c in b."""
    c, s, x, y = cos(a_b.theta), sin(a_b.theta), b_c.x, b_c.y
    theta = (a_b.theta + b_c.theta + pi) % TAU - pi  # as `wrap`
    return Pose2D(a_b.x + c * x - s * y, a_b.y + s * x + c * y, pi if theta == -pi else theta)


def inverse(a_b: Pose2D) -> Pose2D:
    """Return the pose of a in b, from b in a."""
    c, s = cos(a_b.theta), sin(a_b.theta)
    return Pose2D(-c * a_b.x - s * a_b.y, s * a_b.x - c * a_b.y, wrap(-a_b.theta))


def between(a_b: Pose2D, a_c: Pose2D) -> Pose2D:
    """Return the pose of c in b, from b and c in a."""
    c, s, x, y = cos(a_b.theta), sin(a_b.theta), a_b.x, a_b.y
    back = wrap(-a_b.theta)
    theta = (back + a_c.theta + pi) % TAU - pi  # as `compose(inverse(a_b), a_c)`, to the last bit, in one call
    to_c, to_s = cos(back), sin(back)
    return Pose2D(
        -c * x - s * y + to_c * a_c.x - to_s * a_c.y,
        s * x - c * y + to_s * a_c.x + to_c * a_c.y,
        pi if theta == -pi else theta,
    )


def along_arc(pose: Pose2D, twist: Twist, duration_s: float) -> Pose2D:
    """Return a unicycle's pose after `duration_s` of constant `twist`: equation (1) integrated exactly as an arc."""
    turn = twist.angular_z * duration_s
    half = 0.5 * turn
    # `sinc` and `wrap`, without a call for each: this is called a hundred times a second for each robot.
    chord = twist.linear_x * duration_s * (sin(half) / half if not -1e-6 <= half <= 1e-6 else 1.0 - half * half / 6.0)
    middle, theta = pose.theta + half, (pose.theta + turn + pi) % TAU - pi
    return Pose2D(pose.x + chord * cos(middle), pose.y + chord * sin(middle), pi if theta == -pi else theta)


def places_along(pose: Pose2D, twist: Twist, durations_s: Sequence[float]) -> list[Point]:
    """Return the positions of `along_arc` after each of `durations_s`, to the last bit, in one call."""
    x, y, theta, v, omega = pose.x, pose.y, pose.theta, twist.linear_x, twist.angular_z
    places = []
    for duration_s in durations_s:
        half = 0.5 * (omega * duration_s)
        chord = v * duration_s * (sin(half) / half if not -1e-6 <= half <= 1e-6 else 1.0 - half * half / 6.0)
        places.append((x + chord * cos(theta + half), y + chord * sin(theta + half)))
    return places


def part_of_arc(step: Pose2D, part: float) -> Pose2D:
    """Return the first `part` (0 to 1) of `step`, a motion with constant twist (end pose in the frame of the start)."""
    rest = 0.5 * (part - 1.0) * step.theta
    length = part * sinc(0.5 * part * step.theta) / sinc(0.5 * step.theta)
    c, s = length * cos(rest), length * sin(rest)
    return Pose2D(c * step.x - s * step.y, s * step.x + c * step.y, part * step.theta)


def sinc(x: float) -> float:
    """Return sin(x)/x, exact at zero."""
    return sin(x) / x if abs(x) > 1e-6 else 1.0 - x * x / 6.0


def distance(a: Pose2D, b: Pose2D) -> float:
    """Return the straight-line distance [m] between two positions."""
    return hypot(a.x - b.x, a.y - b.y)


def bearing(origin: Pose2D, target: Pose2D) -> float:
    """Return the direction [rad] from `origin` to `target`, in the frame of both."""
    return atan2(target.y - origin.y, target.x - origin.x)


def in_base(pose: Pose2D, point: Point) -> Point:
    """Return `point` (x, y [m] in `map`) in the base frame of `pose`."""
    dx, dy = point[0] - pose.x, point[1] - pose.y
    c, s = cos(pose.theta), sin(pose.theta)
    return c * dx + s * dy, c * dy - s * dx


CORNER_M_MIN = 0.001
"""Length [m] whose square is the least area by which a corner of a convex polygon turns left."""


def convex(corners_m: Sequence[tuple[float, float]]) -> bool:
    """Return True if every corner turns left and the corners turn once around in all (a pentagram turns twice)."""
    if len(corners_m) < 3:
        return False
    turned_rad = 0.0
    for n, (cx, cy) in enumerate(corners_m):
        (ax, ay), (bx, by) = corners_m[n - 2], corners_m[n - 1]
        across = (bx - ax) * (cy - by) - (by - ay) * (cx - bx)
        if across <= CORNER_M_MIN**2:
            return False
        turned_rad += atan2(across, (bx - ax) * (cx - bx) + (by - ay) * (cy - by))
    return turned_rad < 1.5 * TAU
