"""Uncertainty of a pose (x, y, theta), updated one scalar at a time so that no matrix is inverted."""

from __future__ import annotations

from math import sqrt


class Covariance:
    """Symmetric 3x3 covariance: the error of a pose in `map` axes [m, m, rad]."""

    __slots__ = ("_rows", "heading_rad", "position_m")

    def __init__(self, position: float = 0.0, heading: float = 0.0) -> None:
        self._rows = [[position, 0.0, 0.0], [0.0, position, 0.0], [0.0, 0.0, heading]]
        self._spread()

    def move(self, dx: float, dy: float) -> None:
        """Propagate a motion by (dx, dy): a heading error before it is a lateral error after it."""
        p = self._rows
        xt, yt, tt = p[0][2], p[1][2], p[2][2]
        p[0][0] += -2.0 * dy * xt + dy * dy * tt
        p[1][1] += 2.0 * dx * yt + dx * dx * tt
        p[0][1] += dx * xt - dy * yt - dx * dy * tt
        p[1][0] = p[0][1]
        p[0][2] = p[2][0] = xt - dy * tt
        p[1][2] = p[2][1] = yt + dx * tt
        self._spread()

    def grow(self, position: float, heading: float) -> None:
        """Add variances [m^2, rad^2]."""
        p = self._rows
        p[0][0] += position
        p[1][1] += position
        p[2][2] += heading
        self._spread()

    def _spread(self) -> None:
        """Compute what each control step asks for, and only a fix changes."""
        rows = self._rows
        self.position_m = sqrt(max(rows[0][0], rows[1][1]))
        """Standard deviation [m] of the position, in its worse axis."""
        self.heading_rad = sqrt(max(0.0, rows[2][2]))
        """Standard deviation [rad] of the heading."""

    def admits(self, innovation: tuple[float, float, float], variances: tuple[float, float], sigma: float) -> bool:
        """Return whether each component of a measured pose error is within `sigma` standard deviations."""
        position, heading = variances
        noise = (position, position, heading)
        return all(abs(innovation[i]) <= sigma * sqrt(self._rows[i][i] + noise[i]) for i in range(3))

    def update(
        self, innovation: tuple[float, float, float], variances: tuple[float, float]
    ) -> tuple[float, float, float]:
        """Update with a measured error whose variances are (position, heading); return the correction of the pose."""
        position, heading = variances
        correction = [0.0, 0.0, 0.0]
        for i, variance in enumerate((position, position, heading)):
            column = [row[i] for row in self._rows]
            weight = 1.0 / (column[i] + variance)
            rest = (innovation[i] - correction[i]) * weight
            for a in range(3):
                correction[a] += column[a] * rest
                for b in range(3):
                    self._rows[a][b] -= column[a] * column[b] * weight
        self._spread()
        return correction[0], correction[1], correction[2]
