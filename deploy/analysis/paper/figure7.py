"""Properties of figure 7, the distance error: a flat baseline, and spikes that each have a cause."""

from __future__ import annotations

import numpy as np

from lfa.deploy.analysis import episodes
from lfa.deploy.analysis.paper.criteria import Measured
from lfa.deploy.analysis.paper.experiment import Subject, explained, on_course, share, where

LATE_SHARE = 0.1


def baseline(s: Subject) -> Measured:
    worst, who = 0.0, ""
    for robot, e in s.run.errors.items():
        calm = episodes.quiet(s.run, robot, e, s.episodes)
        if calm.any():
            at = int(np.argmax(np.where(calm, np.abs(e.distance), 0.0)))
            worst, who = max((worst, who), (float(abs(e.distance[at])), f"robot {robot} at {e.t[at]:.1f} s"))
    return Measured(worst, who)


def spikes_explained(s: Subject) -> Measured:
    return explained(s, s.distance)


def episodes_felt(s: Subject) -> Measured:
    avoidances = [one for one in s.episodes if one.kind == "avoidance"]
    mute = [one for one in avoidances if not episodes.felt(s.run, one, s.distance)]
    named = [f"robot {one.robot} at {one.from_s:.1f} s" for one in mute]
    return Measured(share(len(avoidances) - len(mute), len(avoidances)), ", ".join(named))


def early_spikes(s: Subject) -> Measured:
    """Return the number of spikes in the first half of the course minus the second, without those of the start."""
    halves = [0, 0]
    for spike in on_course(s):
        rows = s.run.truth[spike.robot]
        way = np.cumsum(np.hypot(np.diff(rows[:, 1], prepend=rows[0, 1]), np.diff(rows[:, 2], prepend=rows[0, 2])))
        at = min(int(np.searchsorted(rows[:, 0], spike.from_s)), way.size - 1)
        halves[int(way[at] > 0.5 * way[-1])] += 1
    return Measured(halves[0] - halves[1], f"{halves[0]} in the first half, {halves[1]} in the second")


def late_spikes(s: Subject) -> Measured:
    late = [spike for spike in s.distance if spike.until_s > (1.0 - LATE_SHARE) * s.end_s]
    return Measured(len(late), where(late))
