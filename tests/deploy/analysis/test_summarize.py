"""What a summary says of one robot, from recordings and events whose answers are known."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lfa.deploy.analysis.summarize import LEFT_BEHIND_M, _left_behind, _robot, overload, summarize, summary_of
from lfa.deploy.analysis.summary import RobotSummary, Summary
from lfa.deploy.analysis.summary_table import text
from lfa.deploy.recording.mcap_reader import Array, RecordedRun
from lfa.deploy.recording.outcome import Verdict
from lfa.deploy.recording.run_folder import About
from lfa.deploy.run.simulate import run
from lfa.world.description.load import load

T = np.arange(0.0, 10.0, 0.02)
K, PHI = 1.2, 2.0 * pi / 3.0
SETTLES_S = 4.0
LAST_M, LAST_RAD = 0.02, 0.1
"""Errors of the last sample, unlike all others."""


def _truth(x: Array, y: Array, theta: float = 0.0, speed: float = -0.5) -> Array:
    return np.column_stack([T, x, y, theta + 0.0 * T, speed + 0.0 * T, 0.0 * T])


def _run(off_m: Array, avoids_at_s: float = 6.0) -> RecordedRun:
    """Robot 2 follows robot 1, `off_m` [m] too far out; it avoids something for a second."""
    t = T[::2]
    avoids = (t >= avoids_at_s) & (t < avoids_at_s + 1.0)
    tracking = np.column_stack([t, 1.0 + 0.0 * t, K + 0.0 * t, PHI + 0.0 * t, 0.0 * t, 0.0 * t, 0.0 * t, avoids])
    angle = PHI + np.where(T[-1] == T, LAST_RAD, 0.0)
    follower = _truth(0.5 * T + (K + off_m) * np.cos(angle), (K + off_m) * np.sin(angle))
    return RecordedRun({1: _truth(0.5 * T, 0.0 * T), 2: follower}, {2: tracking}, {}, {})


LATE = np.where(SETTLES_S > T, 0.3, np.where(T[-1] == T, LAST_M, 0.01))


def line(kind: str, robot: int = 2, **facts: Any) -> dict[str, Any]:
    return {"t": 1.0, "robot": robot, "kind": kind, **facts}


def test_a_follower_has_errors_from_when_it_settled_on() -> None:
    robot = _robot(2, _run(LATE), [])
    assert robot.settled_after_s == pytest.approx(SETTLES_S)
    assert robot.distance_error_rms_m == pytest.approx(0.01, abs=0.001)
    assert robot.distance_error_max_m == pytest.approx(LAST_M)
    assert robot.final_distance_error_m == pytest.approx(LAST_M)
    assert robot.final_bearing_error_rad == pytest.approx(LAST_RAD)
    assert robot.avoidances == 1
    assert robot.excused_s == pytest.approx(1.0, abs=0.05)
    assert robot.bearing_error_rms_rad == pytest.approx(0.0, abs=0.01)
    assert robot.heading_error_rms_rad == pytest.approx(0.0, abs=1e-9)


def test_a_follower_that_never_settles_has_a_last_error_and_no_rms() -> None:
    robot = _robot(2, _run(0.3 + 0.0 * T, avoids_at_s=99.0), [])
    assert robot.settled_after_s is None
    assert robot.distance_error_rms_m is None and robot.distance_error_max_m is None
    assert robot.final_distance_error_m == pytest.approx(0.3)


def test_a_leader_has_a_place_and_a_speed_and_no_errors() -> None:
    robot = _robot(1, _run(LATE), [])
    assert robot.final_pose is not None
    assert robot.final_pose[:2] == pytest.approx((0.5 * T[-1], 0.0))
    assert robot.final_speed_mps == 0.5
    assert robot.final_distance_error_m is None and robot.settled_after_s is None


def test_a_robot_that_nobody_saw_has_no_place() -> None:
    robot = _robot(3, _run(LATE), [])
    assert robot.final_pose is None and robot.final_speed_mps is None
    assert robot.alive and robot.role_at_end == "waiting"


@pytest.mark.parametrize(
    ("events", "alive"),
    [
        ([line("fault", deed="kill")], False),
        ([line("fault", deed="terminate")], False),
        ([line("died")], False),
        ([line("fault", deed="stop")], True),
        ([line("fault", deed="kill"), line("fault", deed="restart")], True),
        ([line("fault", deed="restart"), line("died")], False),
        ([line("fault", robot=1, deed="kill")], True),
    ],
)
def test_a_robot_is_alive_unless_its_last_end_had_no_restart(events: list[dict[str, Any]], alive: bool) -> None:
    assert _robot(2, _run(LATE), events).alive is alive


def test_the_role_at_the_end_is_the_last_one() -> None:
    events = [line("role", role="follower"), line("role", role="leader"), line("role", robot=1, role="waiting")]
    assert _robot(2, _run(LATE), events).role_at_end == "leader"


def test_an_obstacle_is_met_once_until_the_robot_resumes() -> None:
    met = [("wall", "left"), ("wall", "left"), ("moving", "wait"), ("wall", "resume"), ("wall", "right")]
    events = [line("decision", **{"class": kind, "action": action}) for kind, action in met]
    events.append(line("contact"))
    robot = _robot(2, _run(LATE), events)
    assert {kind: n for kind, n in robot.obstacles_met.items() if n} == {"wall": 2, "moving": 1}
    assert robot.contacts == 1


def test_a_machine_that_does_not_keep_up_is_summed_up_by_what_stood_still_and_who_was_late() -> None:
    events = [
        line("slowed", stood_still_s=0.5),
        line("slowed", stood_still_s=0.75),
        line("slowed", stood_still_s="long"),
        line("late", late=True, lag_s=0.2),
        line("late", late=True, lag_s=0.3),
        line("late", late=False, lag_s=0.0),
    ]
    found = overload(events)
    assert found is not None
    assert (found.stood_still_s, found.late_s) == (1.25, {"robot2": 0.3})
    assert overload([line("contact"), line("slowed", stood_still_s=0.06)]) is None


def _at(distance_m: float | None) -> RobotSummary:
    return RobotSummary(
        id=2, alive=True, role_at_end="follower", final_pose=None, final_speed_mps=None, contacts=0, obstacles_met={},
        orientation_requests=0, final_distance_error_m=distance_m,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("distance_m", "chain", "left"),
    [
        (0.9 * LEFT_BEHIND_M, (1, 2), False),
        (1.1 * LEFT_BEHIND_M, (1, 2), True),
        (-1.1 * LEFT_BEHIND_M, (1, 2), False),  # its trace turns back
        (1.1 * LEFT_BEHIND_M, (2, 1), False),  # the leader follows nobody
        (0.0, (1, 3), True),
        (None, (1, 2), False),
    ],
)
def test_left_behind_is_who_is_out_of_the_chain_or_far_behind_its_predecessor(
    distance_m: float | None, chain: tuple[int, ...], left: bool
) -> None:
    assert _left_behind(_at(distance_m), chain) is left


def test_a_run_is_summed_up_with_its_times_and_judged_by_its_assertions(tmp_path: Path) -> None:
    """Two robots for two seconds; no number in it is a measurement of this machine's speed."""
    folder = tmp_path / "run"
    run(load("straight", ("time_limit_s=2.0", "mission.robots=[1,2]")), 1, folder)
    verdict, about = Verdict("time_limit", "over"), About("straight", "simulated", 1, "fleet")
    summary = summarize(folder, about, verdict, 0.1234567, ["kill 2 at 9 s"])
    assert summary.duration_s == 0.123
    assert summary.sim_duration_s == pytest.approx(2.0, abs=0.1)
    assert summary.real_time_factor == pytest.approx(summary.sim_duration_s / 0.1234567, abs=0.1)
    assert summarize(folder, about, verdict, 0.0, []).real_time_factor == 0.0
    judged = {assertion.name: (assertion.ok, assertion.text) for assertion in summary.assertions}
    assert judged["no_violations"] == (True, "")
    assert judged["all_faults_done"] == (False, "kill 2 at 9 s")
    assert judged["goal_reached"] == (False, "over")
    assert summary.assertions[0].name == "goal_reached"
    assert [robot.role_at_end for robot in summary.robots] == ["leader", "follower"]
    assert summary.robots[0].final_distance_error_m is None and summary.robots[1].final_distance_error_m is not None


def _summed(*events: dict[str, Any], verdict: Verdict | None = None, faults_left: tuple[str, ...] = ()) -> Summary:
    """Sum up ten seconds in which robot 2 follows robot 1, and nobody saw robot 3; they took two seconds to compute."""
    scenario = load("straight", ("mission.robots=[1,2,3]",))
    about = About("straight", "simulated", 1, "fleet")
    return summary_of(scenario, _run(LATE), list(events), about, verdict or Verdict("goal_reached"), 2.0, faults_left)


def _chain(*robots: int, number: int) -> dict[str, Any]:
    return line("chain", robot=1, term=[number, 1, 1], seq=0, chain=list(robots))


def test_a_run_arrived_at_its_last_goal() -> None:
    assert _summed(line("goal", t=3.0), line("goal", t=7.0), line("role", t=8.0, role="leader")).arrived_at_s == 7.0
    assert _summed().arrived_at_s is None


def test_time_is_counted_in_the_run_and_on_the_machine() -> None:
    summary = _summed()
    assert (summary.duration_s, summary.sim_duration_s) == (2.0, pytest.approx(T[-1]))
    assert summary.real_time_factor == pytest.approx(T[-1] / 2.0, abs=0.01)


def test_who_is_alive_and_out_of_the_newest_chain_is_left_behind() -> None:
    old, new = _chain(1, 2, 3, number=1), _chain(1, 2, number=2)
    assert _summed(old, new).left_behind == [3]
    assert _summed(old).left_behind == []
    assert _summed(new, line("died", robot=3)).left_behind == []


def test_a_term_that_went_back_is_a_violation_and_fails_its_assertion() -> None:
    commands = [line("leader_command", robot=1, term=[number, 1, 1]) for number in (2, 1)]
    summary = _summed(*commands)
    assert [violation.invariant for violation in summary.violations] == ["I2"]
    judged = {assertion.name: assertion.ok for assertion in summary.assertions}
    assert judged["no_violations"] is False and judged["all_faults_done"] is True


def test_a_recording_of_a_fleet_is_not_judged_by_a_goal_and_a_run_is() -> None:
    names = [assertion.name for assertion in _summed(verdict=Verdict("recorded")).assertions]
    assert "goal_reached" not in names and names[:2] == ["no_violations", "all_faults_done"]
    reached = _summed().assertions[0]
    assert (reached.name, reached.ok, reached.text) == ("goal_reached", True, "")


def test_a_robot_whose_controller_failed_has_kept_no_distance_and_one_that_failed_otherwise_has() -> None:
    assert _robot(2, _run(LATE), [line("failed", controller="law: no way")]).final_distance_error_m is None
    assert _robot(2, _run(LATE), [line("failed")]).final_distance_error_m is not None
    assert _robot(2, _run(LATE), [line("failed", robot=1, controller="law: no way")]).final_distance_error_m is not None


def test_a_leaders_own_requests_for_a_formation_are_counted_and_an_operators_are_not() -> None:
    asked = [line("formation", by=by) for by in ("leader", "operator", "leader")]
    assert _robot(2, _run(LATE), [*asked, line("formation", robot=1, by="leader")]).orientation_requests == 2


def test_a_robot_that_was_seen_has_a_way_a_mean_speed_and_a_clearance() -> None:
    first, _, unseen = _summed().robots
    assert first.way_m == pytest.approx(0.5 * T[-1])
    assert first.mean_speed_mps == pytest.approx(0.5, abs=0.01)
    assert first.least_clearance_m == pytest.approx(K - 0.3, abs=0.01)
    assert unseen.way_m is None and unseen.mean_speed_mps is None and unseen.least_clearance_m is None


def test_errors_are_excused_while_a_robot_avoids_and_counted_in_seconds() -> None:
    robot = _robot(2, _run(LATE, avoids_at_s=5.0), [])
    assert robot.excused_s == pytest.approx(1.0, abs=0.05)
    assert robot.formation_changes == 0
    assert robot.final_pose is not None and robot.final_pose[2] == 0.0


def test_left_behind_robots_are_judged_by_the_scenarios_bound() -> None:
    judged = {a.name: a.ok for a in _summed(_chain(1, 2, number=1)).assertions}
    assert judged["left_behind_max"] is False
    assert {a.name: a.ok for a in _summed(_chain(1, 2, 3, number=1)).assertions}["left_behind_max"] is True


def test_the_final_pose_is_place_and_heading_of_the_last_sample() -> None:
    seen = RecordedRun({2: _truth(0.5 * T, 0.1 * T, theta=0.4)}, {}, {}, {})
    assert _robot(2, seen, []).final_pose == pytest.approx((0.5 * T[-1], 0.1 * T[-1], 0.0, 0.4))


def test_another_place_in_the_formation_is_a_change_of_it() -> None:
    seen = _run(LATE, avoids_at_s=99.0)
    seen.tracking[2][200:, 2] = K + 0.1
    robot = _robot(2, seen, [])
    assert (robot.formation_changes, robot.avoidances) == (1, 0)
    assert robot.bearing_error_body_rms_rad is not None


def test_an_unknown_class_of_obstacle_is_counted_as_any_other() -> None:
    events = [line("decision", **{"class": "fog", "action": "left"})]
    assert _robot(2, _run(LATE), events).obstacles_met["fog"] == 1


def test_a_machine_falls_behind_by_standing_still_alone_or_by_late_robots_alone() -> None:
    late, stood = overload([line("late", lag_s=0.2)]), overload([line("slowed", stood_still_s=5.1234)])
    assert late is not None and (late.stood_still_s, late.late_s) == (0.0, {"robot2": 0.2})
    assert stood is not None and (stood.stood_still_s, stood.late_s) == (5.123, {})
    assert overload([line("late", lag_s=0.2, robot="world"), line("late", lag_s=0.0)]) is None


def test_who_stepped_less_often_is_summed_up_by_its_lowest_rate() -> None:
    events = [
        line("rate", late=True, control_hz=25.0),
        line("rate", late=True, control_hz=12.5),
        line("rate", late=False, control_hz=50.0),
        line("rate", late=True, control_hz="none"),
    ]
    found = overload(events)
    assert found is not None and found.slow_hz == {"robot2": 12.5}
    assert overload([line("rate", late=False, control_hz=50.0)]) is None


def test_a_world_that_was_late_is_named_beside_the_robots() -> None:
    late = [{**line("late", lag_s=0.4), "robot": None, "from": "world"}, line("late", lag_s=0.2)]
    told = text(_summed(*late), None)
    assert "this machine did not keep up: the world was late by 0.40 s; 1 robot was late, robot2 by 0.20 s" in told


def test_a_machine_that_does_not_keep_up_is_one_line_of_the_end_and_no_failure() -> None:
    events = [line("late", lag_s=0.2), line("slowed", stood_still_s=1.0), line("rate", late=True, control_hz=12.5)]
    summary = _summed(_chain(1, 2, 3, number=1), *events)
    [told] = [row for row in text(summary, None).splitlines() if "did not keep up" in row]
    assert told == (
        "  this machine did not keep up: the world stood still for 1.00 s; 1 robot was late, robot2 by 0.20 s; "
        "1 robot did less to keep time, robot2 stepped at 12.5 Hz"
    )
    assert summary.outcome == "goal_reached" and summary.exit_code == 0
