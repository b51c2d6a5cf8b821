"""The covariance, updated one scalar at a time: it is that of the Kalman filter in matrices."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest

from lfa.agents.localization.covariance import Covariance


def test_moves_growth_and_fixes_are_those_of_the_kalman_filter_in_matrices() -> None:
    chance, own = Random(3), Covariance(0.04, 0.09)
    p = np.diag([0.04, 0.04, 0.09])
    for _ in range(12):
        dx, dy = chance.uniform(-2.0, 2.0), chance.uniform(-2.0, 2.0)
        motion = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
        p = motion @ p @ motion.T
        own.move(dx, dy)
        assert own.position_m == pytest.approx(max(p[0, 0], p[1, 1]) ** 0.5)
        more, turned = chance.uniform(0.01, 0.05), chance.uniform(0.01, 0.05)
        p += np.diag([more, more, turned])
        own.grow(more, turned)
        assert own.position_m == pytest.approx(max(p[0, 0], p[1, 1]) ** 0.5)
        assert own.heading_rad == pytest.approx(p[2, 2] ** 0.5)
        innovation = (chance.gauss(0.0, 0.3), chance.gauss(0.0, 0.3), chance.gauss(0.0, 0.3))
        gain = p @ np.linalg.inv(p + np.diag([0.02, 0.02, 0.03]))
        p = (np.eye(3) - gain) @ p
        assert own.update(innovation, (0.02, 0.03)) == pytest.approx(tuple(gain @ innovation))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("component", "bound"), [(0, 10.0), (1, 10.0), (2, 20.0)])
def test_a_fix_is_admitted_up_to_so_many_deviations_in_each_component(
    component: int, bound: float, sign: float
) -> None:
    """Own and fix's variances add: 9 + 16 of the position, 36 + 64 of the heading."""
    own = Covariance(9.0, 36.0)

    def admitted(error: float) -> bool:
        x, y, theta = (sign * error if n == component else 0.0 for n in range(3))
        return own.admits((x, y, theta), (16.0, 64.0), 2.0)

    assert admitted(bound)
    assert not admitted(bound + 1e-9)


def test_a_pose_that_nothing_is_said_of_is_certain() -> None:
    assert Covariance().position_m == 0.0
    assert not Covariance().admits((0.0, 0.0, 1e-9), (0.0, 0.0), 5.0)
