"""Properties of figure 8, the orientation error, and of the order of the chain."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import nan

import numpy as np

from lfa.deploy.analysis import episodes
from lfa.deploy.analysis.paper.criteria import Measured
from lfa.deploy.analysis.paper.experiment import Subject, explained, share
from lfa.deploy.recording import event_log

REQUEST_S = 3.0
"""Maximum time [s] from a request to the spike of the first follower's bearing error."""
SAID_S = 0.1
"""Upper bound [s] of a request's latency; the request is repeated only after a second."""


def requests_seen(s: Subject) -> Measured:
    """Return the share of requests after which the first follower's bearing error rises within `REQUEST_S`.

    A request that does not change the first follower's bearing counts as answered.
    """
    asked, mute = episodes.requests(s.run), []
    for at_s in asked:
        first = next((robot for robot, e in s.run.errors.items() if _second_in_chain(s, robot, at_s)), None)
        e = s.run.errors.get(first or 0)
        window = None if e is None else (e.t >= at_s) & (e.t <= at_s + REQUEST_S)
        if e is None or window is None or not window.any() or not _asked_anew(s, first or 0, at_s):
            continue
        if np.abs(e.bearing_asked[window]).max() <= episodes.SPIKE_RAD:
            mute.append(at_s)
    note = ", ".join(f"none after {at_s:.1f} s" for at_s in mute) if asked else "no request in this run"
    return Measured(share(len(asked) - len(mute), len(asked)), note)


def _asked_anew(s: Subject, robot: int, at_s: float) -> bool:
    """Return True if the request changes the bearing that `robot` is commanded to keep."""
    said = s.run.seen.commanded.get(robot)
    if said is None:
        return False
    before, after = (said[said[:, 0] <= at_s + later_s, 2] for later_s in (-SAID_S, SAID_S))
    return not before.size or bool(before[-1] != after[-1])


def bearings_explained(s: Subject) -> Measured:
    return explained(s, s.bearing)


def after_switch(s: Subject) -> Measured:
    """Return the longest time [s] from a role switch to a follower's recovered bearing or to another disturbance."""
    worst, note = nan, "no role switch in this run"
    for before, led in pairwise(s.run.leader_terms):
        for robot, e in s.run.errors.items():
            if robot == before.robot_id:  # it may return at the tail, which is a rejoin
                continue
            after = (e.t >= led.from_s) & (e.t <= _undisturbed_until(s, robot, led.from_s))
            off = after & (np.abs(e.bearing) >= episodes.BASE_RAD)
            if not after.any():
                continue
            took = float(e.t[np.flatnonzero(off)[-1]]) - led.from_s if off.any() else 0.0
            if not took <= worst:
                worst, note = took, f"robot {robot} after {led.from_s:.1f} s"
    return Measured(worst, note)


def chain_kept(s: Subject) -> Measured:
    """Count the chains out of order: not the chain before with robots removed and others appended at the tail."""
    before: list[int] = []
    newest: tuple[object, ...] = ()
    wrong = []
    for line in event_log.of_kind(s.run.events, "chain"):
        version, chain = (tuple(line["term"] or ()), line.get("seq", 0)), list(line.get("chain", []))
        if newest and version <= newest:
            continue
        kept = [robot for robot in before if robot in chain]
        if before and chain[: len(kept)] != kept and not _tail_only(before, chain):
            wrong.append(f"{before} to {chain} at {line['t']:.1f} s")
        before, newest = chain, version
    return Measured(len(wrong), ", ".join(wrong))


def _second_in_chain(s: Subject, robot: int, at_s: float) -> bool:
    return len(episodes.upstream(s.run, robot, at_s)) == 2


def _undisturbed_until(s: Subject, robot: int, after_s: float) -> float:
    later = [
        one.from_s
        for one in s.episodes
        if one.kind in ("avoidance", "switch") and one.from_s > after_s
        and (one.robot is None or one.robot in episodes.upstream(s.run, robot, one.from_s))
    ]  # fmt: skip
    return min(later, default=s.end_s)


def _tail_only(before: Sequence[int], after: Sequence[int]) -> bool:
    """Return True if `after` is `before` with some robots removed, and these or others appended at its tail."""
    kept = 0
    for robot in before:
        if kept < len(after) and after[kept] == robot:
            kept += 1
    return kept > 0
