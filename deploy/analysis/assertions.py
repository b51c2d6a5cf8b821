"""Evaluation of a scenario's `[assert]` table against the results of a run: one assertion for each given key.

A bound on an event that never happened (a failover, a contact) holds. A bound on an error fails when the run has no
value for it: a follower that never settled has not kept its distance. A run that reaches its goal may leave nobody
behind, unless the scenario allows it or a fault holds the robot.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from itertools import combinations
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from lfa.deploy.analysis.tracking_errors import TrackingErrors
from lfa.deploy.recording.event_log import FaultDone
from lfa.deploy.recording.mcap_reader import RecordedRun
from lfa.deploy.whole_output import whole_file
from lfa.protocol.errors import Refused
from lfa.world.description.scenario import Assert

if TYPE_CHECKING:
    from lfa.deploy.analysis.summary import Summary
from lfa.deploy.analysis.summary import Assertion

ENDED_BY = {"continue": "stop", "heal": "cut", "resume": "hang"}
"""Fault actions that end another one: for the robots that they name, or for all."""


def judge(wanted: Assert, summary: Summary, seen: RecordedRun, followed: Iterable[TrackingErrors]) -> list[Assertion]:
    """Return one assertion for each bound in `wanted`. `followed`: errors of the followers alive at the end."""
    errors = list(followed)
    followers = [robot for robot in summary.robots if robot.settled_after_s is not None or robot.final_distance_error_m]
    #    name                   bound                         found                                                 unit
    table: tuple[tuple[str, float | None, float, str], ...] = (
        ("distance_error_max_m", wanted.distance_error_max_m, _most(_largest(e) for e in errors), "m"),
        ("distance_error_rms_m", wanted.distance_error_rms_m, _most(r.distance_error_rms_m for r in followers), "m"),
        (
            "bearing_error_rms_rad",
            wanted.bearing_error_rms_rad,
            _most(r.bearing_error_rms_rad for r in followers),
            "rad",
        ),
        ("settled_within_s", wanted.settled_within_s, _most(r.settled_after_s for r in followers), "s"),
        ("recovered_within_s", wanted.recovered_within_s, _most(f.chain_ms for f in summary.failovers) / 1000.0, "s"),
        ("failover_max_ms", wanted.failover_max_ms, _most(f.first_command_ms for f in summary.failovers), "ms"),
        ("contacts_max", wanted.contacts_max, sum(robot.contacts for robot in summary.robots), ""),
        ("duration_max_s", wanted.duration_max_s, summary.sim_duration_s, "s"),
        ("leaders_max", wanted.leaders_max, len(summary.leaders), ""),
    )
    judged = [_at_most(name, found, bound, unit) for name, bound, found, unit in table if bound is not None]
    if wanted.left_behind_max is not None or (wanted.goal_reached and summary.outcome == "goal_reached"):
        judged.append(_left_behind(summary, wanted.left_behind_max or 0))
    if wanted.separation_min_m is not None:
        nearest = separation_min_m(seen)
        text = f"{nearest:.3f} m, at least {wanted.separation_min_m:g} m wanted"
        judged.append(Assertion("separation_min_m", nearest >= wanted.separation_min_m, text))
    return judged


def _left_behind(summary: Summary, bound: int) -> Assertion:
    """Judge how many robots were left behind, without those that a fault kept from coming."""
    held = held_by_faults(summary.faults)
    left = [robot for robot in summary.left_behind if robot not in held]
    names = f" (robot {', '.join(map(str, left))})" if left else ""
    return Assertion("left_behind_max", len(left) <= bound, f"{len(left)}{names}, at most {bound} wanted")


def held_by_faults(faults: Sequence[FaultDone]) -> set[int]:
    """Return the robots that a fault still froze, cut off or deprived of a part when the run ended."""
    held: dict[str, set[int]] = {"stop": set(), "cut": set(), "hang": set()}
    for fault in faults:
        robots = {int(word) for word in re.findall(r"\d+", str(fault.target))}
        if fault.kind in held:
            held[fault.kind] |= robots
        elif fault.kind in ENDED_BY:
            ended = held[ENDED_BY[fault.kind]]
            ended -= robots or set(ended)
    return set().union(*held.values())


def separation_min_m(seen: RecordedRun) -> float:
    """Return the minimum distance [m] between the centres of any two robots over the run; inf for a single robot."""
    nearest = inf
    for a, b in combinations(seen.truth.values(), 2):
        n = min(a.shape[0], b.shape[0])
        nearest = min(nearest, float(np.min(np.hypot(a[:n, 1] - b[:n, 1], a[:n, 2] - b[:n, 2]))))
    return nearest


def check_junit(path: Path) -> None:
    """Raise Refused when `path` is not writable; checked before a run, so that it does not fail afterwards."""
    if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        raise Refused(f"--junit {path}: cannot be written, must be a file in a folder that is there")


def junit(path: Path, summary: Summary) -> None:
    """Write the assertions as JUnit XML for CI systems. Raises Refused when the file cannot be written."""
    suite = quoteattr(f"lfa.{summary.scenario}")
    failed = sum(not assertion.ok for assertion in summary.assertions)
    cases = "".join(_case(assertion, suite) for assertion in summary.assertions)
    head = f'tests="{len(summary.assertions)}" failures="{failed}" errors="0" time="{summary.duration_s:.3f}"'
    about = f'<properties><property name="seed" value="{summary.seed}"/></properties>'
    text = f'<?xml version="1.0" encoding="utf-8"?>\n<testsuite name={suite} {head}>{about}{cases}</testsuite>\n'
    try:
        with whole_file(path) as fresh:
            fresh.write_text(text, encoding="utf-8")
    except OSError as error:
        raise Refused(f"--junit {path}: cannot be written ({error.strerror})") from None


def _case(assertion: Assertion, suite: str) -> str:
    head = f"<testcase classname={suite} name={quoteattr(assertion.name)}"
    if assertion.ok:
        return f"{head}/>"
    message = assertion.text or "does not hold"
    return f"{head}><failure message={quoteattr(message)}>{escape(message)}</failure></testcase>"


def _at_most(name: str, found: float, bound: float, unit: str) -> Assertion:
    shown = "none to judge" if found == inf else f"{found:.4g} {unit}".rstrip()
    return Assertion(name, found <= bound, f"{shown}, at most {bound:g} {unit}".rstrip() + " wanted")


def _most(values: Iterable[float | None]) -> float:
    """Return the maximum of `values`; inf when one is None, 0 when there are none."""
    return max((inf if value is None else value for value in values), default=0.0)


def _largest(e: TrackingErrors) -> float | None:
    return float(np.max(np.abs(e.distance[e.steady]))) if e.steady.any() else None
