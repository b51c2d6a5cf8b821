"""Properties of figure 9, the path flow: the robots' paths and the obstacles along them."""

from __future__ import annotations

from math import isfinite, nan

import numpy as np

from lfa.deploy.analysis.paper.criteria import Measured
from lfa.deploy.analysis.paper.experiment import BASELINE_M, STRAIGHT_RADPS, Subject
from lfa.deploy.analysis.paper.footprints import outside_m, overlap_m
from lfa.deploy.recording import event_log
from lfa.deploy.recording.mcap_reader import Array

SWITCH_S = 8.0


def bounded(s: Subject) -> Measured:
    return Measured(max((outside_m(s.run, rows) for rows in s.run.truth.values()), default=nan))


def ends_at_goal(s: Subject) -> Measured:
    """Return the largest excess [m] of a robot's final distance to the goal over what its place in the chain allows."""
    mission = s.run.scenario.mission
    chain = event_log.last_chain(s.run.events)
    away, note = nan, ""
    for place, robot in enumerate(chain):
        rows = s.run.truth.get(robot)
        if rows is None:
            continue
        x, y = rows[-1, 1], rows[-1, 2]
        over = float(np.hypot(x - mission.goal_m[0], y - mission.goal_m[1])) - place * mission.formation.separation_m
        if not over <= away:
            away, note = over, f"robot {robot}"
    return Measured(away, note)


def counts_differ(s: Subject) -> Measured:
    """Return the number of different counts of obstacles met.

    Does not apply in iteration 2 when the team passed all known obstacles and met none.
    """
    met = [sum(robot.obstacles_met.values()) for robot in s.run.summary.robots]
    if s.run.scenario.mission.leading.known_m and not any(met):
        return Measured(nan, "all known obstacles passed by")
    return Measured(len(set(met)), ", ".join(map(str, met)))


def on_new_trace(s: Subject) -> Measured:
    """Return the largest median offset [m] of a follower from the last new leader's path, less its slots' offset."""
    if len(s.run.leader_terms) < 2:
        return Measured(nan, "no role switch in this run")
    led = s.run.leader_terms[-1]
    path = s.run.truth[led.robot_id]
    path = path[path[:, 0] >= led.from_s]
    worst, note = nan, ""
    for robot, e in s.run.errors.items():
        steady = e.steady & (e.t >= led.from_s + SWITCH_S) & (np.abs(e.distance) < BASELINE_M)
        rows = s.run.truth[robot]
        rows = rows[np.isin(rows[:, 0], e.t[steady]) & (np.abs(rows[:, 5]) < STRAIGHT_RADPS)][::5]
        off = [_beside(path, row) - _asked_beside(s, robot, led.robot_id, float(row[0])) for row in rows]
        off = [one for one in off if isfinite(one)]
        if off and not (middle := float(np.median(np.abs(off)))) <= worst:
            worst, note = middle, f"robot {robot}, median"
    return Measured(worst, note or "no steady way after the switch")


def no_overlap(s: Subject) -> Measured:
    return Measured(overlap_m(s.run))


def _beside(path: Array, row: Array) -> float:
    """Return the signed distance [m], left positive, of the point in `row` from the path at its nearest sample.

    nan when that is the first or last sample of the path.
    """
    gaps = np.hypot(path[:, 1] - row[1], path[:, 2] - row[2])
    i = int(np.argmin(gaps))
    if i in (0, path.shape[0] - 1):
        return nan
    theta = path[i, 3]
    return float(np.cos(theta) * (row[2] - path[i, 2]) - np.sin(theta) * (row[1] - path[i, 1]))


def _asked_beside(s: Subject, robot: int, leader: int, at_s: float) -> float:
    """Return k sin(phi) [m], summed over the hops from `leader` to `robot`; nan when the robot is not behind it."""
    beside, seen = 0.0, set()
    while robot != leader:
        e = s.run.errors.get(robot)
        said = s.run.seen.tracking.get(robot)
        if e is None or said is None or robot in seen:
            return nan
        seen.add(robot)
        i = max(0, int(np.searchsorted(said[:, 0], at_s, side="right")) - 1)
        beside += float(said[i, 2] * np.sin(said[i, 3]))
        robot = int(said[i, 1])
    return beside
