"""Errors from ground truth and commands whose answers are known."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from lfa.deploy.analysis.tracking_errors import RECOVERY_S_MAX, Mask, TrackingErrors, of_follower
from lfa.deploy.recording.mcap_reader import Array, RecordedRun

K, PHI = 1.2, 2.0 * pi / 3.0
T = np.arange(0.0, 20.0, 0.02)


def _leader(theta: Array | float = 0.0) -> Array:
    """Half a metre a second along x."""
    return np.column_stack([T, 0.5 * T, 0.0 * T, theta + 0.0 * T, 0.5 + 0.0 * T, 0.0 * T])


def _follower(behind: Array | float = 0.0, theta: float = 0.0) -> Array:
    """In its slot, but `behind` [m] farther out along the bearing."""
    separation = K + behind + 0.0 * T
    x, y = 0.5 * T + separation * np.cos(PHI), separation * np.sin(PHI)
    return np.column_stack([T, x, y, theta + 0.0 * T, 0.5 + 0.0 * T, 0.0 * T])


def _tracking(
    phi: Array | float = PHI, chi: float = 0.0, avoiding: Array | Mask | bool = False, to: Array | int = 1
) -> Array:
    t = T[::2]
    columns = (t, np.broadcast_to(to, t.shape), K + 0.0 * t, phi + 0.0 * t, chi + 0.0 * t, 0.0 * t, 0.0 * t)
    return np.column_stack([*columns, np.broadcast_to(avoiding, t.shape)])


def _errors(leader: Array, follower: Array, tracking: Array) -> TrackingErrors:
    found = of_follower(RecordedRun({1: leader, 2: follower}, {2: tracking}, {}, {}), 2)
    assert found is not None
    return found


def test_who_stands_in_its_slot_has_no_error() -> None:
    e = _errors(_leader(), _follower(), _tracking())
    for values in (e.distance, e.bearing, e.bearing_body, e.heading):
        assert np.abs(values).max() < 1e-12
    assert e.settled_after_s == 0.0


def test_distance_error_is_distance_less_what_was_commanded() -> None:
    assert _errors(_leader(), _follower(0.1), _tracking()).distance == pytest.approx(0.1)


def test_bearing_is_judged_by_chi_and_bearing_body_by_the_predecessors_heading() -> None:
    e = _errors(_leader(theta=0.2), _follower(), _tracking(chi=0.0))
    assert np.abs(e.bearing).max() < 1e-12
    assert e.bearing_body == pytest.approx(-0.2)


def test_heading_error_is_the_feasible_headings() -> None:
    assert _errors(_leader(), _follower(theta=0.3), _tracking()).heading == pytest.approx(-0.3)


def test_settled_is_for_good() -> None:
    late = np.where((T > 8.0) & (T < 9.0), 0.06, 0.0)
    settled = _errors(_leader(), _follower(late), _tracking()).settled_after_s
    assert settled == pytest.approx(9.0, abs=0.03)


def test_an_avoidance_is_excused_until_the_robot_is_back() -> None:
    t = T[::2]
    late = np.where((T > 8.1) & (T < 12.0), 0.5, 0.0)
    e = _errors(_leader(), _follower(late), _tracking(avoiding=(t > 8.0) & (t < 9.0)))
    assert e.settled_after_s == 0.0
    assert not (e.steady & (e.t > 8.15) & (e.t < 11.95)).any()
    assert (e.steady & (e.t > 12.05)).any()


def test_who_does_not_come_back_is_excused_no_longer() -> None:
    t = T[::2]
    away = np.where(T > 5.0, 0.5, 0.0)
    e = _errors(_leader(), _follower(away), _tracking(avoiding=(t > 5.0) & (t < 6.0)))
    assert e.settled_after_s is None
    assert not e.excused[e.t > 6.0 + RECOVERY_S_MAX + 0.1].any()


def test_a_new_place_in_the_formation_is_excused() -> None:
    t = T[::2]
    swap = np.where((T > 8.1) & (T < 10.0), 0.3, 0.0)
    e = _errors(_leader(), _follower(swap), _tracking(phi=PHI + 1e-3 * np.clip(t - 8.0, 0.0, 0.3)))
    assert e.changing.any()
    assert e.settled_after_s == 0.0


def test_a_robot_that_is_no_longer_told_whom_to_follow_has_no_error() -> None:
    tracking = _tracking()
    e = _errors(_leader(), _follower(), tracking[tracking[:, 0] < 5.0])
    assert e.t.max() < 5.3
