"""Intermediate results of a run that several properties of the paper's figures share."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import nan

from lfa.deploy.analysis import episodes
from lfa.deploy.analysis.episodes import Episode, Spike
from lfa.deploy.analysis.paper.criteria import Measured
from lfa.deploy.analysis.run_data import Run
from lfa.deploy.recording import event_log

BASELINE_M = episodes.BASE_M
REST_MPS = 0.01
STRAIGHT_RADPS = 0.05


class Subject:
    """One recorded run with its episodes and spikes. Distances in metres, angles in radians, times in seconds."""

    def __init__(self, run: Run) -> None:
        self.run = run

    @cached_property
    def end_s(self) -> float:
        return self.run.seen.end_s

    @cached_property
    def episodes(self) -> list[Episode]:
        return episodes.episodes(self.run)

    @cached_property
    def distance(self) -> list[Spike]:
        return episodes.distance_spikes(self.run)

    @cached_property
    def bearing(self) -> list[Spike]:
        return episodes.bearing_spikes(self.run)

    def alive(self) -> list[int]:
        """Return the followers in the last chain that have tracking errors."""
        chain = event_log.last_chain(self.run.events)[1:]
        return [robot for robot in chain if robot in self.run.errors]


def on_course(s: Subject) -> list[Spike]:
    """Return the spikes of the distance error, without those of robots that move to their slots at the start."""
    starts = [one for one in s.episodes if one.kind == "start"]
    return [
        spike
        for spike in s.distance
        if not any(one.robot == spike.robot and one.touches(spike.from_s, spike.until_s) for one in starts)
    ]


def duration_s(s: Subject, spike: Spike) -> float:
    """Return the duration [s] of the avoidances that caused a spike, overlaps counted once; 0 without an avoidance.

    An avoidance that began at most `FELT_S` before the spike may have caused it and counts from its own start. An
    earlier one, for example of a robot that is stuck for long, did not start the spike and counts from the spike's
    start. The time after the end of the spike never counts.
    """
    avoided = [one for one in episodes.causes(s.run, spike, s.episodes) if one.kind == "avoidance"]
    began = [(one, one.from_s if one.from_s >= spike.from_s - episodes.FELT_S else spike.from_s) for one in avoided]
    spans = [(from_s, min(one.until_s, spike.until_s)) for one, from_s in began]
    return sum(until_s - from_s for from_s, until_s in episodes.merged(span for span in spans if span[0] < span[1]))


def explained(s: Subject, found: Sequence[Spike]) -> Measured:
    strays = [spike for spike in found if not episodes.causes(s.run, spike, s.episodes)]
    return Measured(share(len(found) - len(strays), len(found)), where(strays))


def share(part: int, whole: int) -> float:
    return part / whole if whole else nan


def where(found: Sequence[Spike]) -> str:
    return ", ".join(f"robot {one.robot} from {one.from_s:.1f} to {one.until_s:.1f} s" for one in found)
