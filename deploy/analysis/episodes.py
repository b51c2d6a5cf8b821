"""Spikes of a tracking error, and the avoidance episodes and other events of a run that cause them (control.md 7.1).

A spike is an excursion of the error: it begins where the error leaves its baseline, ends where the error is back, and
its peak exceeds the bar; two spikes less than `APART_S` apart count as one. An episode is an interval in which a robot
did something besides following: it avoided an obstacle, its place in the formation changed, the chain got a new
leader, or the robot was still moving to its slot at the start. A disturbance propagates down the chain, so a spike is
attributed to episodes of the robot itself and of the robots ahead of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from msgspec import Struct

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.tracking_errors import RECOVERY_S_MAX, Mask, TrackingErrors
from lfa.deploy.recording import event_log
from lfa.deploy.recording.mcap_reader import Array

APART_S = 1.0
"""Gap [s] up to which two spikes, or two intervals, count as one."""
BASE_M, SPIKE_M = 0.02, 0.05
"""Baseline and bar [m] of a spike of the distance error."""
BASE_RAD, SPIKE_RAD = 0.05, 0.10
"""Baseline and bar [rad] of a spike of the bearing error."""
FELT_S = 3.0
"""Maximum delay [s] from the end of an episode to a spike that it causes, in the own error or down the chain."""
START_S = 0.5
"""Duration [s] after its first command in which a follower counts as moving to its slot."""


class Spike(Struct, frozen=True):
    """Excursion of one robot's tracking error from its baseline, with its times [s]."""

    robot: int
    from_s: float
    until_s: float
    peak: float
    """Largest magnitude, in the unit of the error."""

    @property
    def width_s(self) -> float:
        return self.until_s - self.from_s


class Episode(Struct, frozen=True):
    """Interval [s] in which a robot, or the team, did something besides following."""

    robot: int | None
    """Id of the robot; None when the episode concerns the whole team."""
    kind: str
    """Kind of the episode: `avoidance`, `formation`, `switch` or `start`."""
    from_s: float
    until_s: float

    def touches(self, from_s: float, until_s: float) -> bool:
        return self.from_s <= until_s and self.until_s >= from_s


def stretches(t: Array, mask: Mask, apart_s: float = 0.0) -> list[tuple[float, float]]:
    """Return the first and last time [s] of each interval of True; intervals at most `apart_s` apart are joined."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    found = zip(t[edges[::2]].tolist(), t[edges[1::2] - 1].tolist(), strict=True)
    return merged(found, apart_s)


def merged(spans: Iterable[tuple[float, float]], apart_s: float = 0.0) -> list[tuple[float, float]]:
    """Return the spans [s] sorted by time, with those at most `apart_s` apart joined."""
    found: list[tuple[float, float]] = []
    for from_s, until_s in sorted(spans):
        if found and from_s - found[-1][1] <= apart_s:
            found[-1] = (found[-1][0], max(found[-1][1], until_s))
        else:
            found.append((from_s, until_s))
    return found


def spikes(robot: int, t: Array, error: Array, base: float, bar: float) -> list[Spike]:
    """Return the excursions of `error` from its baseline `base` whose peak exceeds `bar`."""
    size = np.abs(error)
    found = []
    for from_s, until_s in stretches(t, size > base, APART_S):
        peak = float(size[(t >= from_s) & (t <= until_s)].max())
        if peak > bar:
            found.append(Spike(robot, from_s, until_s, peak))
    return found


def distance_spikes(run: Run) -> list[Spike]:
    return [one for robot, e in run.errors.items() for one in spikes(robot, e.t, e.distance, BASE_M, SPIKE_M)]


def bearing_spikes(run: Run) -> list[Spike]:
    return [one for robot, e in run.errors.items() for one in spikes(robot, e.t, e.bearing_asked, BASE_RAD, SPIKE_RAD)]


def episodes(run: Run) -> list[Episode]:
    """Return all episodes of a run, from its event log and its tracking errors, ordered by start time."""
    found = [Episode(robot, "avoidance", *span) for robot in run.robots for span in avoidances(run, robot)]
    for robot, e in run.errors.items():
        found += [Episode(robot, "formation", *span) for span in stretches(e.t, e.changing, APART_S)]
        found.append(Episode(robot, "start", float(e.t[0]), float(e.t[0]) + START_S))
    found += [Episode(None, "formation", at_s, at_s) for at_s in requests(run)]
    found += [Episode(None, "switch", led.from_s, led.from_s) for led in run.leader_terms[1:]]
    return sorted(found, key=lambda one: one.from_s)


def requests(run: Run) -> list[float]:
    """Return the times [s] of the leader's orientation requests; those that an operator caused are left out."""
    return [line["t"] for line in event_log.of_kind(run.events, "formation") if event_log.asked_by_leader(line)]


def avoidances(run: Run, robot: int) -> list[tuple[float, float]]:
    """Return the avoidances [s] of a robot from its event log: from the first decision to the `resume` that ends it."""
    spans: list[tuple[float, float]] = []
    since: float | None = None
    for line in event_log.of_kind(run.events, "decision"):
        if line["robot"] != robot:
            continue
        if line["action"] != "resume":
            since = line["t"] if since is None else since
        elif since is not None:
            spans.append((since, line["t"]))
            since = None
    if since is not None:
        spans.append((since, run.seen.end_s))
    return merged(spans, APART_S)


def upstream(run: Run, robot: int, at_s: float) -> set[int]:
    """Return the ids of `robot` and of all robots ahead of it in the chain at time `at_s` [s]."""
    found = {robot}
    while (e := run.errors.get(robot)) is not None and e.t[0] <= at_s:
        robot = int(e.predecessor[max(0, int(np.searchsorted(e.t, at_s, side="right")) - 1)])
        if robot in found:
            break
        found.add(robot)
    return found


def causes(run: Run, spike: Spike, known: Sequence[Episode]) -> list[Episode]:
    """Return the episodes of the robot or of robots ahead that overlap `spike` or ended within `FELT_S` before it."""
    ahead = upstream(run, spike.robot, spike.from_s) | upstream(run, spike.robot, spike.until_s)
    return [
        one
        for one in known
        if (one.robot is None or one.robot in ahead) and one.touches(spike.from_s - FELT_S, spike.until_s)
    ]


def felt(run: Run, episode: Episode, found: Sequence[Spike]) -> bool:
    """Return True if a spike of the robot or of one behind it overlaps `episode` or follows it within `FELT_S`."""
    return any(
        episode.touches(spike.from_s - FELT_S, spike.until_s)
        and (episode.robot is None or episode.robot in upstream(run, spike.robot, spike.from_s))
        for spike in found
    )


def quiet(run: Run, robot: int, e: TrackingErrors, known: Sequence[Episode]) -> Mask:
    """Return a mask of a follower's samples that no episode of the robot itself or of a robot ahead disturbs.

    An episode also disturbs each excursion from the baseline that it overlaps, or that it precedes by at most
    `RECOVERY_S_MAX`.
    """
    calm = np.ones(e.t.size, dtype=bool)
    about = [one for one in known if one.robot is None or one.robot in upstream(run, robot, one.from_s)]
    for one in about:
        calm &= (e.t < one.from_s) | (e.t > one.until_s)
    for from_s, until_s in stretches(e.t, np.abs(e.distance) > BASE_M, APART_S):
        if any(one.touches(from_s - RECOVERY_S_MAX, until_s) for one in about):
            calm &= (e.t < from_s) | (e.t > until_s)
    return calm


def rank_correlation(a: Sequence[float], b: Sequence[float]) -> float:
    """Return Spearman's rank correlation, ties ranked by their mean; nan below three values or if one is constant."""
    if len(a) < 3:
        return float("nan")
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.corrcoef(_ranks(a), _ranks(b))[0, 1])


def _ranks(values: Sequence[float]) -> Array:
    _, place, count = np.unique(np.asarray(values), return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - 0.5 * (count - 1))[place])
