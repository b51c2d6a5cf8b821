"""Properties of figure 11, the tracking output: errors that vanish, speeds that ramp up, dip and end."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, nan

import numpy as np

from lfa.deploy.analysis import episodes
from lfa.deploy.analysis.paper.criteria import Measured
from lfa.deploy.analysis.paper.experiment import REST_MPS, STRAIGHT_RADPS, Subject, share
from lfa.deploy.recording import event_log
from lfa.deploy.recording.mcap_reader import Array

DIP, DIP_S_MIN = 0.95, 0.5
START_M = -1.2
CATCH_UP_S = 15.0


def starts_at(s: Subject) -> Measured:
    first = s.run.errors.get(s.run.robots[1]) if len(s.run.robots) > 1 else None
    return Measured(nan if first is None else abs(float(np.min(first.distance[first.t <= 1.0])) - START_M))


def final_distance(s: Subject) -> Measured:
    return _worst_final(s, lambda robot: float(abs(s.run.errors[robot].distance[-1])))


def final_bearing(s: Subject) -> Measured:
    return _worst_final(s, lambda robot: float(abs(s.run.errors[robot].bearing_asked[-1])))


def ramp(s: Subject) -> Measured:
    """Return the relative deviation of the leader's time to 90 % of cruise speed from that of its set acceleration."""
    t, v = _leader_speed(s)
    leading = s.run.scenario.mission.leading
    moving, there = np.flatnonzero(v > REST_MPS), np.flatnonzero(v > 0.9 * leading.cruise_mps)
    if not moving.size or not there.size:
        return Measured(1e9, "never at cruise speed")
    took_s, due_s = float(t[there[0]] - t[moving[0]]), 0.9 * leading.cruise_mps / leading.acceleration_mps2
    return Measured(abs(took_s / due_s - 1.0), f"{took_s:.2f} s, {due_s:.2f} s due")


def plateau(s: Subject) -> Measured:
    t, v = _leader_speed(s)
    cruise = s.run.scenario.mission.leading.cruise_mps
    middle = (t > 0.1 * s.end_s) & (t < 0.9 * s.end_s)
    return Measured(abs(float(np.median(v[middle])) / cruise - 1.0) if middle.any() else nan)


def dips(s: Subject) -> Measured:
    t, v = _leader_speed(s)
    cruise = s.run.scenario.mission.leading.cruise_mps
    leader = s.run.leader_terms[0].robot_id if s.run.leader_terms else 0
    spans = [span for span in episodes.avoidances(s.run, leader) if span[1] - span[0] >= DIP_S_MIN]
    dipped = sum(bool((v[(t >= a) & (t <= b)] < DIP * cruise).any()) for a, b in spans)
    return Measured(share(dipped, len(spans)), f"{dipped} of {len(spans)} avoidances of the leader")


def over_speed(s: Subject) -> Measured:
    cruise = s.run.scenario.mission.leading.cruise_mps
    rows = [rows[rows[:, 0] < CATCH_UP_S] for robot, rows in s.run.truth.items() if robot in s.run.errors]
    return Measured(max((float(row[:, 4].max()) for row in rows if row.size), default=nan) / cruise)


def same_speed(s: Subject) -> Measured:
    """Return the largest median difference [m/s] to the leader's speed, for settled followers on a straight path."""
    t, v = _leader_speed(s)
    worst, note = nan, ""
    for robot in s.alive():
        e, rows = s.run.errors[robot], s.run.truth[robot]
        even = np.isin(rows[:, 0], e.t[e.steady]) & (np.abs(rows[:, 5]) < STRAIGHT_RADPS) & (rows[:, 4] > REST_MPS)
        if even.any():
            off = float(np.median(np.abs(rows[even, 4] - np.interp(rows[even, 0], t, v))))
            worst, note = max((worst if isfinite(worst) else -1.0, note), (off, f"robot {robot}"))
    return Measured(worst, note)


def final_speed(s: Subject) -> Measured:
    chain = event_log.last_chain(s.run.events)
    return Measured(
        max((float(abs(s.run.truth[robot][-1, 4])) for robot in chain if robot in s.run.truth), default=nan)
    )


def stops(s: Subject) -> Measured:
    """Return the largest delay [s] per hop from the leader's rest to a follower's rest."""
    chain = [robot for robot in event_log.last_chain(s.run.events) if robot in s.run.truth]
    if len(chain) < 2:
        return Measured(nan)
    rest = [_rest_s(s.run.truth[robot]) for robot in chain]
    return Measured(max((at - rest[0]) / hop for hop, at in enumerate(rest[1:], start=1)))


def _leader_speed(s: Subject) -> tuple[Array, Array]:
    rows = s.run.truth[s.run.leader_terms[0].robot_id if s.run.leader_terms else s.run.robots[0]]
    return rows[:, 0], rows[:, 4]


def _worst_final(s: Subject, of: Callable[[int], float]) -> Measured:
    found = [(of(robot), f"robot {robot}") for robot in s.alive()]
    return Measured(*max(found)) if found else Measured(nan)


def _rest_s(rows: Array) -> float:
    moving = np.flatnonzero(np.abs(rows[:, 4]) > REST_MPS)
    return float(rows[moving[-1], 0]) if moving.size else 0.0
