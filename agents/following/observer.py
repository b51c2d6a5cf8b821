"""Observers of a predecessor's pose and velocity from its sampled poses (control.md section 3).

Form B (`Observer`) is an alpha-beta observer of a unicycle with the poles of the paper's gain matrix
[[4, 6], [-11.9, 9]], -6.5 +- 8.07i, exact for any sampling interval. Form A (`SlotVelocityObserver`) is that matrix
taken literally: output injection on the slot's position in the follower's frame, with the slot's velocity as unknown
input. All stamps here are of the sender's clock; the caller converts.
"""

from __future__ import annotations

from math import cos, exp, hypot, isfinite, sin, sqrt
from typing import Literal

from lfa.agents.localization.plausibility import plausible
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, wrap

Mode = Literal["velocity", "pose"]

REAL = 6.5
"""Half the trace of L [1/s]."""
IMAGINARY = sqrt(107.4 - REAL * REAL)
"""sqrt(det L - (tr L / 2)^2) = 8.0716 [rad/s]."""
L = ((4.0, 6.0), (-11.9, 9.0))
"""The paper's observer values, row by row [1/s]."""

JUMP_M = 0.15
"""Distance [m] from the prediction above which a position is a fault; two in a row are a jump."""
JUMP_MPS2 = 1.0
"""Acceleration [m/s^2] that a sound predecessor may have between two samples; it widens `JUMP_M`."""


class Observer:
    """Form B. In `velocity` mode it uses the published twist, and the innovations only as a fault monitor."""

    def __init__(self, mode: Mode = "velocity", extrapolation_max_s: float = 0.5) -> None:
        self._with_velocity = mode == "velocity"
        self._extrapolation_max_s = extrapolation_max_s
        self._stamp: float | None = None
        self._pose = Pose2D()
        self._twist = STILL
        self._suspect: Pose2D | None = None
        self.jumps = 0
        """Number of jumps of the predecessor; each one restarts the estimate."""
        self.suspects = 0
        self.refused = 0

    @property
    def stamp(self) -> float | None:
        """Stamp of the newest accepted message; None before the first."""
        return self._stamp

    def heard(self, stamp: float, pose: Pose2D, twist: Twist) -> bool:
        """Update with a sampled pose; return False when it is refused: not finite, implausible, not newer, or an
        outlier.
        """
        if not (isfinite(stamp) and plausible(pose, twist)):
            self.refused += 1
            return False
        if self._stamp is None:
            self._seed(stamp, pose, twist)
            return True
        h = stamp - self._stamp
        if h <= 0.0:
            self.refused += 1
            return False
        predicted = along_arc(self._pose, self._twist, min(h, self._extrapolation_max_s))
        rx, ry = pose.x - predicted.x, pose.y - predicted.y
        if not self._expected(hypot(rx, ry), h):
            return self._suspicious(stamp, pose, twist)
        self._suspect = None
        if h > self._extrapolation_max_s:
            self._seed(stamp, pose, twist)
        elif self._with_velocity:
            self._stamp, self._pose, self._twist = stamp, pose, twist
        else:
            self._correct(stamp, h, predicted, rx, ry, wrap(pose.theta - predicted.theta))
        return True

    def at(self, stamp: float) -> tuple[Pose2D, Twist, float]:
        """Return (pose, twist, age [s]) at `stamp`, along the arc for at most `extrapolation_max_s`.

        Call only after a message was accepted.
        """
        assert self._stamp is not None
        age = stamp - self._stamp
        reach = self._extrapolation_max_s
        ahead = -reach if age < -reach else reach if age > reach else age
        return along_arc(self._pose, self._twist, ahead), self._twist, age

    def _expected(self, residual_m: float, h: float) -> bool:
        unseen = max(0.0, h - self._extrapolation_max_s)
        speed = abs(self._twist.linear_x) + JUMP_MPS2 * h
        return residual_m <= JUMP_M + JUMP_MPS2 * h * h + unseen * speed

    def _suspicious(self, stamp: float, pose: Pose2D, twist: Twist) -> bool:
        """Hold back a message far from the prediction; accept a second one that agrees with it."""
        self.suspects += 1
        previous, self._suspect = self._suspect, pose
        if previous is None or hypot(pose.x - previous.x, pose.y - previous.y) > JUMP_M:
            return False
        self.jumps += 1
        self._seed(stamp, pose, twist)
        return True

    def _seed(self, stamp: float, pose: Pose2D, twist: Twist) -> None:
        self._stamp, self._pose = stamp, pose
        self._twist = twist if self._with_velocity else STILL
        self._suspect = None

    def _correct(self, stamp: float, h: float, predicted: Pose2D, rx: float, ry: float, rtheta: float) -> None:
        decay = exp(-REAL * h)
        alpha = 1.0 - decay * decay
        beta_h = (1.0 + decay * decay - 2.0 * decay * cos(IMAGINARY * h)) / h
        along = cos(predicted.theta) * rx + sin(predicted.theta) * ry
        self._stamp = stamp
        self._pose = Pose2D(predicted.x + alpha * rx, predicted.y + alpha * ry, wrap(predicted.theta + alpha * rtheta))
        self._twist = Twist(self._twist.linear_x + beta_h * along, self._twist.angular_z + beta_h * rtheta)


class SlotVelocityObserver:
    """Form A, the literal observer of the paper: the slot's velocity as unknown input of the slot's position.

    Both are in the follower's frame. Exact for any constant own turn rate over a sampling interval.
    """

    def __init__(self) -> None:
        self._z: tuple[float, float] | None = None
        self._w = (0.0, 0.0)

    def reset(self) -> None:
        self._z = None
        self._w = (0.0, 0.0)

    def step(self, z: tuple[float, float] | None, own_twist: Twist, h: float) -> tuple[float, float]:
        """Return the slot's velocity in the follower's frame [m/s].

        `z` is the slot's position in that frame, `own_twist` the twist driven for the last `h` seconds. Without a new
        measurement (`z` None) the estimate coasts.
        """
        if self._z is None:
            self._z = z
            return self._w
        turn = own_twist.angular_z * h
        c, s = cos(turn), sin(turn)
        g1, g2 = _integral(turn, h)
        zx, zy = self._z
        v = own_twist.linear_x
        if z is None:
            ux, uy = self._w[0] - v, self._w[1]
            self._z = (c * zx + s * zy + g1 * ux + g2 * uy, -s * zx + c * zy - g2 * ux + g1 * uy)
            return self._w
        px, py = c * zx + s * zy - g1 * v, -s * zx + c * zy + g2 * v
        ex, ey = z[0] - px, z[1] - py
        f11, f12, f21, f22 = _decay(h)
        # rest = (I - G) eps with I - G = exp(-L h); the corrected estimate is z - rest.
        restx, resty = f11 * ex + f12 * ey, f21 * ex + f22 * ey
        self._z = (z[0] - restx, z[1] - resty)
        dx, dy = ex - (c * restx + s * resty), ey - (-s * restx + c * resty)
        det = g1 * g1 + g2 * g2
        self._w = ((g1 * dx - g2 * dy) / det, (g2 * dx + g1 * dy) / det)
        return self._w


def _integral(turn: float, h: float) -> tuple[float, float]:
    """Return Gamma = integral over h of exp(-omega J s) = [[g1, g2], [-g2, g1]] as (g1, g2)."""
    if abs(turn) < 1e-6:
        return h, 0.5 * turn * h
    return h * sin(turn) / turn, h * (1.0 - cos(turn)) / turn


def _decay(h: float) -> tuple[float, float, float, float]:
    """Return exp(-L h), row by row."""
    decay = exp(-REAL * h)
    c, s = decay * cos(IMAGINARY * h), decay * sin(IMAGINARY * h) / IMAGINARY
    return c - (L[0][0] - REAL) * s, -L[0][1] * s, -L[1][0] * s, c - (L[1][1] - REAL) * s
