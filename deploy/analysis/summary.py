"""`summary.json`: what a run came to. Its shape is these types; fields may be added, none renamed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
from msgspec import Struct

from deploy.look import chronicle, errors, trace
from deploy.look.assertions import Assertion, judge
from deploy.look.chronicle import Failover, FaultDone, Line, Reign, Violation
from deploy.look.errors import Errors
from deploy.look.trace import Array, Trace
from deploy.run.folder import About, scenario_of
from deploy.run.record import Recording
from deploy.run.referee import Verdict
from protocol.mission import Refused
from world.scenario import Outcome

SUMMARY = "summary.json"
ENDED_WELL = ("goal_reached", "time_limit")
LEFT_BEHIND_M = 0.5
OBSTACLE_CLASSES = ("stationary", "moving", "pothole", "bump", "wall", "ditch")


class RobotSummary(Struct, kw_only=True):
    """Errors are a follower's; None where it never followed or never settled. Rms values are taken from
    `settled_after_s` on, with avoidance and formation changes (`excused_s` in all) left out."""

    id: int
    alive: bool
    role_at_end: str
    final_pose: tuple[float, float, float, float] | None
    """x, y, z [m], theta [rad] in `map`."""
    final_speed_mps: float | None
    distance_error_rms_m: float | None = None
    distance_error_max_m: float | None = None
    """Largest magnitude once settled, with nothing left out."""
    bearing_error_rms_rad: float | None = None
    bearing_error_body_rms_rad: float | None = None
    heading_error_rms_rad: float | None = None
    final_distance_error_m: float | None = None
    final_bearing_error_rad: float | None = None
    settled_after_s: float | None = None
    avoidances: int = 0
    formation_changes: int = 0
    excused_s: float = 0.0
    contacts: int
    obstacles_met: dict[str, int]
    orientation_requests: int


class Summary(Struct, kw_only=True):
    scenario: str
    mode: str
    """`processes` or `simulated`."""
    seed: int
    outcome: Outcome
    reason: str | None
    duration_s: float
    """Of the run alone, by the wall clock."""
    sim_duration_s: float
    real_time_factor: float
    robots: list[RobotSummary]
    left_behind: list[int] = []
    """Alive at the end, but out of the chain or more than `LEFT_BEHIND_M` out of place in it."""
    leaders: list[Reign]
    failovers: list[Failover]
    faults: list[FaultDone]
    assertions: list[Assertion]
    violations: list[Violation]
    recording: Recording | None = None
    """None when its recorder died before it could count."""

    @property
    def exit_code(self) -> int:
        """0 only for a run that ended by itself with all assertions ok; the goal is one of them by default."""
        return 0 if self.outcome in ENDED_WELL and all(a.ok for a in self.assertions) else 1


def summarize(folder: Path, about: About, verdict: Verdict, duration_s: float, faults_left: Sequence[str]) -> Summary:
    """Read the run in `folder` back and say what it came to. `faults_left`: those that the run ended before."""
    seen, events, scenario = trace.read(folder), chronicle.lines(folder), scenario_of(folder)
    robots = [_robot(robot, seen, events) for robot in scenario.mission.robots]
    chain = chronicle.last_chain(events)
    reigns = chronicle.reigns(events)
    violations = chronicle.terms_that_went_back(events)
    summary = Summary(
        scenario=about.scenario,
        mode=about.mode,
        seed=about.seed,
        outcome=verdict.outcome,
        reason=verdict.reason,
        duration_s=round(duration_s, 3),
        sim_duration_s=round(seen.end_s, 3),
        real_time_factor=round(seen.end_s / duration_s, 2) if duration_s > 0.0 else 0.0,
        robots=robots,
        left_behind=[robot.id for robot in robots if robot.alive and _left_behind(robot, chain)],
        leaders=reigns,
        failovers=chronicle.failovers(events, reigns),
        faults=chronicle.faults(events),
        assertions=[
            Assertion("no_violations", not violations),
            Assertion("all_faults_done", not faults_left, ", ".join(faults_left)),
        ],
        violations=violations,
    )
    wanted = scenario.asserted
    if wanted.goal_reached:
        reached = Assertion("goal_reached", verdict.outcome == "goal_reached", verdict.reason or "")
        summary.assertions.insert(0, reached)
    followed = (errors.of_follower(seen, robot.id) for robot in robots if robot.alive)
    summary.assertions += judge(wanted, summary, seen, [e for e in followed if e is not None])
    return summary


def write(folder: Path, summary: Summary) -> None:
    """All of it or, on a full disk, nothing."""
    fresh = (folder / SUMMARY).with_suffix(".new")
    try:
        fresh.write_bytes(msgspec.json.format(msgspec.json.encode(summary), indent=1) + b"\n")
        fresh.replace(folder / SUMMARY)
    finally:
        fresh.unlink(missing_ok=True)


def read(folder: Path) -> Summary:
    """Raises FileNotFoundError when the run in `folder` has no summary, Refused when it is none of this version's."""
    try:
        return msgspec.json.decode((folder / SUMMARY).read_bytes(), type=Summary)
    except msgspec.DecodeError as error:
        raise Refused(
            f"{folder / SUMMARY}: of another version or damaged ({error}): read it with the lfa of its time"
        ) from None


def _robot(robot: int, seen: Trace, events: Sequence[Line]) -> RobotSummary:
    own = [line for line in events if line["robot"] == robot]
    last = seen.truth[robot][-1] if robot in seen.truth else None
    summary = RobotSummary(
        id=robot,
        alive=_alive(own),
        role_at_end=next((line["role"] for line in reversed(own) if line["kind"] == "role"), "waiting"),
        final_pose=None if last is None else (float(last[1]), float(last[2]), 0.0, float(last[3])),
        final_speed_mps=None if last is None else abs(float(last[4])),
        contacts=sum(1 for _ in chronicle.of_kind(own, "contact")),
        obstacles_met=_obstacles_met(own),
        orientation_requests=sum(map(chronicle.asked_by_leader, chronicle.of_kind(own, "formation"))),
    )
    followed = errors.of_follower(seen, robot)
    if followed is not None:
        _fill_errors(summary, followed)
    return summary


def _left_behind(robot: RobotSummary, chain: Sequence[int]) -> bool:
    follows = robot.id in chain[1:] and robot.final_distance_error_m is not None
    out_of_place = follows and abs(robot.final_distance_error_m or 0.0) > LEFT_BEHIND_M
    return robot.id not in chain or out_of_place


def _fill_errors(summary: RobotSummary, e: Errors) -> None:
    steady = e.steady
    settled = e.settled_after_s
    period_s = float(np.median(np.diff(e.t))) if e.t.size > 1 else 0.0
    summary.settled_after_s = settled
    summary.avoidances = errors.runs(e.avoiding)
    summary.formation_changes = errors.runs(e.changing)
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
    """False when it was last seen to die, by a fault or by itself, and not started again."""
    alive = True
    for line in own:
        if line["kind"] == "died" or (line["kind"] == "fault" and line["deed"] in ("kill", "terminate")):
            alive = False
        elif line["kind"] == "fault" and line["deed"] == "restart":
            alive = True
    return alive


def _obstacles_met(own: Sequence[Line]) -> dict[str, int]:
    """Encounters by class: from a decision to the `resume` that ends it is one, whatever is decided in between."""
    met = dict.fromkeys(OBSTACLE_CLASSES, 0)
    busy: set[str] = set()
    for line in chronicle.of_kind(own, "decision"):
        kind = str(line.get("class"))
        if line.get("action") == "resume":
            busy.clear()
        elif kind not in busy:
            busy.add(kind)
            met[kind] = met.get(kind, 0) + 1
    return met
