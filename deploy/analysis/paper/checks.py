"""Table of the control.md 7.1 properties of a single run, each with its scenarios and its bar."""

from __future__ import annotations

from collections.abc import Callable

from msgspec import Struct

from lfa.deploy.analysis.paper import figure7, figure8, figure9, figure11, final_state
from lfa.deploy.analysis.paper.criteria import Bar, Finding, Measured
from lfa.deploy.analysis.paper.experiment import BASELINE_M, REST_MPS, Subject
from lfa.deploy.analysis.run_data import Run

PATHS = ("paper_path1", "paper_path2")
START = ("paper_fig11",)
PAPER = (*PATHS, *START)

FINAL_M, FINAL_RAD = 0.01, 0.02
MATCHED_MIN = 0.9
SWITCH_S = 8.0
COINCIDE_M = 0.05
OVERLAP_M = 0.005
"""Allowed overlap [m]: 0.5 mm that the physics engine tolerates, plus the motion between two ground truth records."""


class Property(Struct, frozen=True):
    """Property that must hold in a run of one of `scenarios`."""

    bar: Bar
    scenarios: tuple[str, ...]
    measure: Callable[[Subject], Measured]


def of_run(run: Run) -> list[Finding]:
    """Return the findings of all properties of the run's scenario; empty when it is not one of the paper's."""
    subject, name = Subject(run), run.summary.scenario
    return [one.bar.judged(one.measure(subject)) for one in PROPERTIES if name in one.scenarios]


PROPERTIES: tuple[Property, ...] = (
    Property(Bar("run", "goal reached", "=", 1.0), PAPER, final_state.goal),
    Property(Bar("run", "contacts", "=", 0.0), PAPER, final_state.contacts),
    Property(Bar("run", "robots left behind", "=", 0.0), PAPER, final_state.left_behind),
    Property(Bar("7", "distance error outside of events", "<", BASELINE_M, "m"), PATHS, figure7.baseline),
    Property(Bar("7", "spikes with an event", ">=", MATCHED_MIN), PATHS, figure7.spikes_explained),
    Property(Bar("7", "avoidances with a spike", ">=", MATCHED_MIN), PATHS, figure7.episodes_felt),
    Property(Bar("7", "spikes in the first half over the second", ">", 0.0), PATHS, figure7.early_spikes),
    Property(Bar("7", "spikes in the last 10 % of the run", "=", 0.0), PATHS, figure7.late_spikes),
    Property(Bar("8", "requests that F1's bearing answers in 3 s", "=", 1.0), PATHS, figure8.requests_seen),
    Property(Bar("8", "bearing spikes with an event", "=", 1.0), PATHS, figure8.bearings_explained),
    Property(Bar("8", "bearing back after a role switch", "<=", SWITCH_S, "s"), PATHS, figure8.after_switch),
    Property(Bar("8", "chains out of order", "=", 0.0), PAPER, figure8.chain_kept),
    Property(Bar("9", "path outside of the walls", "<=", 0.0, "m"), PATHS, figure9.bounded),
    Property(Bar("9", "beyond the place at the goal", "<", 0.5, "m"), PAPER, figure9.ends_at_goal),
    Property(Bar("9", "different counts of obstacles met", ">", 1.0), PATHS, figure9.counts_differ),
    Property(Bar("9", "off the new leader's trace after a switch", "<", COINCIDE_M, "m"), PATHS, figure9.on_new_trace),
    Property(Bar("9", "overlap of a body with an obstacle", "<", OVERLAP_M, "m"), PAPER, figure9.no_overlap),
    Property(Bar("11a", "first follower's start from -1.2 m", "<", 0.02, "m"), START, figure11.starts_at),
    Property(Bar("11a", "distance error at the end", "<", FINAL_M, "m"), PAPER, figure11.final_distance),
    Property(Bar("11b", "bearing error at the end", "<", FINAL_RAD, "rad"), PAPER, figure11.final_bearing),
    Property(Bar("11c", "leader's ramp, off its acceleration's", "<", 0.2), START, figure11.ramp),
    Property(Bar("11c", "leader's plateau, off the cruise speed", "<", 0.05), START, figure11.plateau),
    Property(Bar("11c", "leader's avoidances with a dip of its speed", "=", 1.0), START, figure11.dips),
    Property(Bar("11d", "followers' over-speed while catching up", ">", 1.05), START, figure11.over_speed),
    Property(Bar("11d", "followers' speed off the leader's, then", "<", 0.02, "m/s"), START, figure11.same_speed),
    Property(Bar("11", "speed at the end", "<", REST_MPS, "m/s"), PAPER, figure11.final_speed),
    Property(Bar("11d", "rest after the leader's, for each hop", "<=", 2.0, "s"), PAPER, figure11.stops),
)  # fmt: skip
