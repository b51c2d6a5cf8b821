"""Quantities of one run that a sweep compares, as a table. A run without a value of one has none there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from math import inf, isfinite
from typing import Literal, NamedTuple

import numpy as np

from lfa.deploy.analysis import tracking_errors
from lfa.deploy.analysis.assertions import separation_min_m
from lfa.deploy.analysis.summary import RobotSummary, Summary
from lfa.deploy.analysis.tracking_errors import TrackingErrors
from lfa.deploy.recording.mcap_reader import RecordedRun

DIGITS = 9
"""Significant digits of a stored value: fewer than machines with other mathematics libraries may differ in."""
QUIET_M = 1e-4
"""Distance error [m] of a predecessor below which an amplification says nothing."""


class RunData(NamedTuple):
    """Results of one run: its summary, its arrays, and the errors of its followers by place in the mission."""

    summary: Summary
    seen: RecordedRun
    errors: Sequence[TrackingErrors]


class Metric(NamedTuple):
    """One quantity: column name with its unit, what it is, and which direction is worse."""

    name: str
    text: str
    worse: Literal["more", "less"]
    of: Callable[[RunData], float | None]


def _robots(get: Callable[[RobotSummary], float | None]) -> Callable[[RunData], float | None]:
    """Return the largest value of any robot; None when no robot has one."""
    return lambda run: _most(get(robot) for robot in run.summary.robots)


def _most(values: Iterable[float | None]) -> float | None:
    return max((value for value in values if value is not None), default=None)


def amplification(errors: Sequence[TrackingErrors], size: Callable[[np.ndarray], float]) -> float | None:
    """Return the largest ratio of a follower's distance error to its predecessor's, each of the norm `size`.

    Counted from when both had settled; None where there are no two followers in a row, or no error to amplify.
    """
    sizes = [size(e.distance[e.steady]) if e.steady.any() else inf for e in errors]
    pairs = [(a, b) for a, b in pairwise(sizes) if isfinite(a) and isfinite(b) and a > QUIET_M]
    return max((b / a for a, b in pairs), default=None)


def _l2(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _linf(values: np.ndarray) -> float:
    return float(np.max(np.abs(values)))


def _spacing(run: RunData) -> float | None:
    found = separation_min_m(run.seen)
    return found if isfinite(found) else None


METRICS: tuple[Metric, ...] = (
    Metric("duration_s", "duration", "more", lambda run: run.summary.sim_duration_s),
    Metric("distance_error_rms_m", "rms distance error of the worst follower", "more",
           _robots(lambda robot: robot.distance_error_rms_m)),
    Metric("distance_error_max_m", "largest distance error after settling", "more",
           _robots(lambda robot: robot.distance_error_max_m)),
    Metric("bearing_error_rms_rad", "rms orientation error of the worst follower", "more",
           _robots(lambda robot: robot.bearing_error_rms_rad)),
    Metric("heading_error_rms_rad", "rms heading error of the worst follower", "more",
           _robots(lambda robot: robot.heading_error_rms_rad)),
    Metric("settled_after_s", "time until the last follower had settled", "more",
           _robots(lambda robot: robot.settled_after_s)),
    Metric("hop_l2", "largest amplification per hop, rms", "more", lambda run: amplification(run.errors, _l2)),
    Metric("hop_linf", "largest amplification per hop, peak", "more", lambda run: amplification(run.errors, _linf)),
    Metric("separation_min_m", "least distance between two robots", "less", _spacing),
    Metric("failover_ms", "longest time without a leader's command", "more",
           lambda run: _most(one.first_command_ms for one in run.summary.failovers)),
    Metric("leaders", "number of leaders", "more", lambda run: float(len(run.summary.leaders))),
    Metric("left_behind", "robots left behind", "more", lambda run: float(len(run.summary.left_behind))),
    Metric("contacts", "contacts", "more", lambda run: float(sum(robot.contacts for robot in run.summary.robots))),
)  # fmt: skip


def metrics_of(summary: Summary, seen: RecordedRun) -> dict[str, float]:
    """Return the quantities of a run that have a finite value in it: no other can be stored."""
    followed = (tracking_errors.of_follower(seen, robot.id) for robot in summary.robots)
    run = RunData(summary, seen, [errors for errors in followed if errors is not None])
    found = {metric.name: metric.of(run) for metric in METRICS}
    return {
        name: float(f"{value:.{DIGITS}g}") for name, value in found.items() if value is not None and isfinite(value)
    }
