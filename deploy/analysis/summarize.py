"""Computation of the summary of a run folder."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path

import numpy as np

from lfa.deploy.analysis import clearance, tracking_errors
from lfa.deploy.analysis.assertions import judge
from lfa.deploy.analysis.summary import Assertion, Overload, RobotSummary, Summary
from lfa.deploy.analysis.tracking_errors import TrackingErrors
from lfa.deploy.recording import event_log, mcap_reader
from lfa.deploy.recording.event_log import Line
from lfa.deploy.recording.mcap_reader import Array, RecordedRun
from lfa.deploy.recording.outcome import Verdict
from lfa.deploy.recording.run_folder import About, scenario_of
from lfa.protocol.names import robot_name
from lfa.world.description.load import Scenario

LEFT_BEHIND_M = 0.5
"""Distance error [m] at the end of a run above which a follower counts as left behind."""
STILL_S_MAX = 0.5
"""Time [s] for which a world may have stood still in a run that its machine kept up with: a few pauses."""
OBSTACLE_CLASSES = ("stationary", "moving", "pothole", "bump", "wall", "ditch")


def summarize(folder: Path, about: About, verdict: Verdict, duration_s: float, faults_left: Sequence[str]) -> Summary:
    """Return the summary of the run in `folder`. `faults_left`: planned faults that the run ended too early for."""
    seen, events = mcap_reader.read(folder), event_log.lines(folder)
    return summary_of(scenario_of(folder), seen, events, about, verdict, duration_s, faults_left)


def summary_of(
    scenario: Scenario,
    seen: RecordedRun,
    events: list[Line],
    about: About,
    verdict: Verdict,
    duration_s: float,
    faults_left: Sequence[str],
) -> Summary:
    """Return the summary of a run of `scenario` (as drawn) from its arrays and its event log."""
    robots = [_robot(robot, seen, events) for robot in scenario.mission.robots]
    for robot in robots:
        _fill_way(robot, seen, scenario)
    chain = event_log.last_chain(events)
    leader_terms = event_log.leader_terms(events)
    violations = event_log.terms_that_went_back(events)
    summary = Summary(
        scenario=about.scenario,
        mode=about.mode,
        seed=about.seed,
        provenance=about.provenance,
        outcome=verdict.outcome,
        reason=verdict.reason,
        duration_s=round(duration_s, 3),
        sim_duration_s=round(seen.end_s, 3),
        real_time_factor=round(seen.end_s / duration_s, 2) if duration_s > 0.0 else 0.0,
        arrived_at_s=next((line["t"] for line in reversed(events) if line["kind"] == "goal"), None),
        robots=robots,
        left_behind=[robot.id for robot in robots if robot.alive and _left_behind(robot, chain)],
        leaders=leader_terms,
        failovers=event_log.failovers(events, leader_terms),
        faults=event_log.faults(events),
        assertions=[
            Assertion("no_violations", not violations),
            Assertion("all_faults_done", not faults_left, ", ".join(faults_left)),
        ],
        violations=violations,
        overload=overload(events),
    )
    wanted = scenario.asserted
    if wanted.goal_reached and verdict.outcome != "recorded":
        reached = Assertion("goal_reached", verdict.outcome == "goal_reached", verdict.reason or "")
        summary.assertions.insert(0, reached)
    followed = (tracking_errors.of_follower(seen, robot.id) for robot in robots if robot.alive)
    summary.assertions += judge(wanted, summary, seen, [e for e in followed if e is not None])
    return summary


def overload(events: Sequence[Line]) -> Overload | None:
    """Return by what a run has shown that its machine did not keep up; None if by nothing."""
    stood_still_s = sum(_number(line.get("stood_still_s")) for line in event_log.of_kind(events, "slowed"))
    late_s: dict[str, float] = {}
    for line in event_log.of_kind(events, "late"):
        lag_s = _number(line.get("lag_s"))
        name = robot_name(line["robot"]) if isinstance(line["robot"], int) else line.get("from")
        if lag_s > 0.0 and isinstance(name, str):
            late_s[name] = max(late_s.get(name, 0.0), lag_s)
    slow_hz: dict[str, float] = {}
    for line in event_log.of_kind(events, "rate"):
        hz = _number(line.get("control_hz"))
        if line.get("late") is True and hz > 0.0 and isinstance(line["robot"], int):
            name = robot_name(line["robot"])
            slow_hz[name] = min(slow_hz.get(name, hz), hz)
    found = stood_still_s > STILL_S_MAX or late_s or slow_hz
    return Overload(stood_still_s=round(stood_still_s, 3), late_s=late_s, slow_hz=slow_hz) if found else None


def _number(said: object) -> float:
    """Return a finite number of an event's data, which any sender may have written; else 0."""
    return float(said) if isinstance(said, int | float) and isfinite(said) else 0.0


def _robot(robot: int, seen: RecordedRun, events: Sequence[Line]) -> RobotSummary:
    own = [line for line in events if line["robot"] == robot]
    last = seen.truth[robot][-1] if robot in seen.truth else None
    summary = RobotSummary(
        id=robot,
        alive=_alive(own),
        role_at_end=next((line["role"] for line in reversed(own) if line["kind"] == "role"), "waiting"),
        final_pose=None if last is None else (float(last[1]), float(last[2]), 0.0, float(last[3])),
        final_speed_mps=None if last is None else abs(float(last[4])),
        contacts=sum(1 for _ in event_log.of_kind(own, "contact")),
        obstacles_met=_obstacles_met(own),
        orientation_requests=sum(map(event_log.asked_by_leader, event_log.of_kind(own, "formation"))),
    )
    followed = tracking_errors.of_follower(seen, robot)
    broken = any(line.get("controller") for line in event_log.of_kind(own, "failed"))
    if followed is not None and not broken:  # a robot that was not controlled has kept no distance
        _fill_errors(summary, followed)
    return summary


def _fill_way(summary: RobotSummary, seen: RecordedRun, scenario: Scenario) -> None:
    """Fill in the way driven and the clearance kept; a run without ground truth has neither."""
    rows = seen.truth.get(summary.id)
    if rows is None:
        return
    summary.way_m, summary.mean_speed_mps = clearance.way_m(rows), clearance.mean_speed_mps(rows)
    least_m = clearance.least_clearance_m(summary.id, seen, scenario)
    summary.least_clearance_m = least_m if isfinite(least_m) else None
    if scenario.mission.leading.motion == "explore":  # its way is planned round obstacles, without a decision
        for kind, count in clearance.things_near(summary.id, seen, scenario).items():
            summary.obstacles_met[kind] = max(summary.obstacles_met[kind], count)


def _left_behind(robot: RobotSummary, chain: Sequence[int]) -> bool:
    """Return whether a robot is out of the chain, or too far from its predecessor. On a trace that turns back it may be
    nearer than it was told, as the crow flies, and in its place.
    """
    too_far = robot.id in chain[1:] and (robot.final_distance_error_m or 0.0) > LEFT_BEHIND_M
    return robot.id not in chain or too_far


def _fill_errors(summary: RobotSummary, e: TrackingErrors) -> None:
    steady = e.steady
    settled = e.settled_after_s
    period_s = float(np.median(np.diff(e.t))) if e.t.size > 1 else 0.0
    summary.settled_after_s = settled
    summary.avoidances = tracking_errors.runs(e.avoiding)
    summary.formation_changes = tracking_errors.runs(e.changing)
    summary.excused_s = round(float(np.count_nonzero(e.excused)) * period_s, 3)
    summary.final_distance_error_m = float(e.distance[-1])
    summary.final_bearing_error_rad = float(e.bearing[-1])
    summary.distance_error_rms_m = _rms(e.distance[steady])
    summary.bearing_error_rms_rad = _rms(e.bearing[steady])
    summary.bearing_error_body_rms_rad = _rms(e.bearing_body[steady])
    summary.heading_error_rms_rad = _rms(e.heading[steady])
    if settled is not None:
        summary.distance_error_max_m = float(np.max(np.abs(e.distance[e.t >= settled])))


def _rms(values: Array) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if values.size else None


def _alive(own: Sequence[Line]) -> bool:
    """Return False if the last event is the process's end, by a fault or by itself, with no restart after it."""
    alive = True
    for line in own:
        if line["kind"] == "died" or (line["kind"] == "fault" and line["deed"] in ("kill", "terminate")):
            alive = False
        elif line["kind"] == "fault" and line["deed"] == "restart":
            alive = True
    return alive


def _obstacles_met(own: Sequence[Line]) -> dict[str, int]:
    """Count encounters by obstacle class; several decisions before one `resume` count once for each class."""
    met = dict.fromkeys(OBSTACLE_CLASSES, 0)
    busy: set[str] = set()
    for line in event_log.of_kind(own, "decision"):
        kind = str(line.get("class"))
        if line.get("action") == "resume":
            busy.clear()
        elif kind not in busy:
            busy.add(kind)
            met[kind] = met.get(kind, 0) + 1
    return met
