"""`[assert]`: each key judged against what was found, in the summary, the exit code and the JUnit file."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from msgspec.structs import replace

from lfa.deploy.analysis.assertions import held_by_faults, judge, junit
from lfa.deploy.analysis.summary import Summary
from lfa.deploy.faults.script import parse_all
from lfa.deploy.recording.event_log import FaultDone
from lfa.deploy.recording.mcap_reader import read
from lfa.deploy.run.simulate import run
from lfa.protocol.errors import Refused
from lfa.world.description.load import load
from lfa.world.description.scenario import Assert

FOUND = (
    #  key                      holds   does not (None: no bound is too narrow for a good run)
    ("distance_error_max_m",    1.0,    1e-9),
    ("distance_error_rms_m",    1.0,    1e-9),
    ("bearing_error_rms_rad",   1.0,    1e-9),
    ("settled_within_s",        10.0,   0.01),
    ("recovered_within_s",      1.0,    1e-4),
    ("failover_max_ms",         200.0,  0.1),
    ("contacts_max",            0,      None),
    ("separation_min_m",        0.3,    5.0),
    ("duration_max_s",          60.0,   1.0),
    ("leaders_max",             2,      1),
    ("left_behind_max",         0,      None),
)  # fmt: skip


def _summary(folder: Path, *overrides: str, fault: str = "kill leader at 2 s") -> Summary:
    scenario = load("straight", ["mission.leading.route_m=[[3.0, 0.0]]", "faults=[]", *overrides])
    return run(scenario, 0, folder, parse_all(scenario.mission, (), [fault])).summary


def _judged(summary: Summary) -> dict[str, bool]:
    return {assertion.name: assertion.ok for assertion in summary.assertions}


def test_every_key_is_tried_here() -> None:
    assert {key for key, *_ in FOUND} == set(Assert.__struct_fields__) - {"goal_reached"}


def test_bounds_that_hold_let_the_run_pass(tmp_path: Path) -> None:
    summary = _summary(tmp_path / "run", *(f"assert.{key}={holds}" for key, holds, _ in FOUND))
    assert [assertion for assertion in summary.assertions if not assertion.ok] == []
    assert {key for key, *_ in FOUND} <= set(_judged(summary))
    assert summary.exit_code == 0


FAR = "world.starts=[[0.0,0.0,0.0],[-0.8,0.0,0.0],[-1.6,0.0,0.0],[-1.6,9.0,0.0]]"
WALLED = "world.walls_m=[[-4.0,7.0,1.0,7.0],[1.0,7.0,1.0,11.0],[1.0,11.0,-4.0,11.0],[-4.0,11.0,-4.0,7.0]]"


def test_a_run_that_leaves_a_robot_behind_fails_unless_the_scenario_allows_it(tmp_path: Path) -> None:
    alone = (FAR, WALLED, "mission.cold_start=majority", "time_limit_s=90.0", "assert.left_behind_max=1")
    allowed = _summary(tmp_path / "run", *alone, fault="heal at 1 s")
    assert (allowed.outcome, allowed.left_behind, allowed.exit_code) == ("goal_reached", [4], 0)
    (judged,) = judge(Assert(), allowed, read(tmp_path / "run"), ())
    assert (judged.name, judged.ok, judged.text) == ("left_behind_max", False, "1 (robot 4), at most 0 wanted")
    assert replace(allowed, assertions=[judged]).exit_code == 1


@pytest.mark.parametrize(
    ("faults", "held"),
    [
        (["stop 2"], {2}),
        (["stop 2", "continue 2"], set()),
        (["cut 1-2", "hang scanner 3"], {1, 2, 3}),
        (["cut 1", "cut 2", "heal "], set()),
        (["hang scanner 3", "resume scanner 3", "kill 4"], set()),
    ],
)
def test_who_is_still_held_by_a_fault_is_not_left_behind(faults: list[str], held: set[int]) -> None:
    done = [FaultDone(1.0, *fault.split(" ", 1)) for fault in faults]
    assert held_by_faults(done) == held


def test_bounds_that_do_not_hold_fail_it_one_by_one(tmp_path: Path) -> None:
    bounds = {key: broken for key, _, broken in FOUND if broken is not None}
    summary = _summary(tmp_path / "run", *(f"assert.{key}={broken}" for key, broken in bounds.items()))
    assert [key for key in bounds if _judged(summary)[key]] == []
    assert summary.exit_code == 1


def test_a_run_that_need_not_arrive_may_end_at_its_limit(tmp_path: Path) -> None:
    summary = _summary(tmp_path / "run", "time_limit_s=2.5", "assert.goal_reached=false")
    assert summary.outcome == "time_limit"
    assert "goal_reached" not in _judged(summary)
    assert summary.exit_code == 0


def test_junit_tells_what_failed_and_by_how_much(tmp_path: Path) -> None:
    path = tmp_path / "lfa.xml"
    junit(path, _summary(tmp_path / "run", "assert.separation_min_m=5.0"))
    suite = ElementTree.parse(path).getroot()
    assert (suite.get("tests"), suite.get("failures")) == ("5", "1")
    failures = {case.get("name"): failure.get("message") for case in suite for failure in case.iter("failure")}
    assert "at least 5 m wanted" in str(failures["separation_min_m"])


def test_an_unknown_key_is_refused_with_the_right_one() -> None:
    with pytest.raises(Refused, match="did you mean 'contacts_max'"):
        load("straight", ["assert.contact_max=0"])
