"""`lfa run`: processes of this machine, from start to goal, with one killed on the way."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from random import Random

import pytest

from lfa.deploy.analysis.summary import read
from lfa.deploy.recording import event_log, mcap_reader
from lfa.protocol.messages.codec import encode
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.simulation import Clock
from lfa.protocol.topics import TOPICS
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from tests.rigs.lfa_runs import SHORT, eventually, lfa, running

pytestmark = pytest.mark.processes

FIRST_COMMAND_MS_MAX = 500.0
DISTANCE_RMS_M_MAX = 0.010
LOST_SHARE_MAX = 0.002  # other tests share the machine: an idle one loses none


def test_a_team_reaches_its_goal_and_keeps_its_distances(tmp_path: Path) -> None:
    done = lfa("run", "straight", *SHORT, "--out", str(tmp_path / "run"), "--json")
    assert done.returncode == 0, done.stderr + done.stdout
    facts = json.loads(done.stdout)
    assert facts["outcome"] == "goal_reached"
    assert facts["violations"] == facts["left_behind"] == []
    for robot in facts["robots"][1:]:
        assert robot["distance_error_rms_m"] < DISTANCE_RMS_M_MAX, robot
        assert robot["final_speed_mps"] < 1e-3, robot


def test_the_run_folder_is_whole(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    done = lfa("run", "straight", *SHORT, "--robots", "2", "--out", str(folder))
    assert done.returncode == 0, done.stderr + done.stdout
    assert done.stdout.splitlines()[-1] == f"run folder: {folder}"
    figures = {path.stem for path in (folder / "figures").iterdir()}
    assert {"fig07_distance_error", "fig08_orientation_error", "fig09_path_flow", "fig11_tracking"} <= figures
    logs = {path.name for path in (folder / "logs").iterdir()}
    assert logs == {f"{name}.log" for name in ("router", "recorder", "world", "robot1", "robot2")}
    assert " robot1 role " in (folder / "logs" / "robot1.log").read_text()
    journals = sorted(path.name.split("-")[0] for path in (folder / "journal").iterdir())
    assert journals == ["robot1", "robot2", "witness", "world"]
    assert set(mcap_reader.read(folder).truth) == {1, 2}
    assert read(folder).robots[1].distance_error_rms_m is not None
    ticks = [
        said.counters.get("tick_p99_ms", 0.0) for _, _, _, said in mcap_reader.messages(folder, frozenset({"status"}))
    ]
    assert max(ticks) > 0.0
    first = {line["kind"]: line["t"] for line in reversed(event_log.lines(folder))}
    assert 0.0 < first["over"] < first["peer_down"], "what counts is how it was before all were told to stop"


def test_the_next_in_chain_takes_over_within_half_a_second(tmp_path: Path) -> None:
    killed = ("--set", "mission.leading.route_m=[[3.0, 0.0]]", "--set", 'faults=["kill leader at 2 s"]')
    done = lfa("run", "leader_killed", *killed, "--out", str(tmp_path / "run"), "--no-figures")
    assert done.returncode == 0, done.stderr + done.stdout
    summary = read(tmp_path / "run")
    failover = summary.failovers[0]
    assert (failover.victim, failover.leader) == (1, 2)
    assert failover.first_command_ms is not None
    assert 0.0 < failover.first_command_ms < FIRST_COMMAND_MS_MAX
    assert summary.violations == []
    assert [robot.alive for robot in summary.robots] == [False, True, True, True]
    said = (tmp_path / "run" / "logs" / "recorder.log").read_text()
    count = {name: int(number) for number, name in re.findall(r"(\d+) (\w+)", said)}
    lost = count["missing"] + count["dropped"]
    assert lost <= LOST_SHARE_MAX * count["recorded"], "the recorder loses nothing when a robot is killed"


def test_a_stopped_robot_goes_on_when_it_is_woken(tmp_path: Path) -> None:
    fault = ("--fault", "stop 2 at 2 s for 0.3 s")
    done = lfa("run", "straight", *SHORT, "--robots", "2", *fault, "--out", str(tmp_path / "run"), "--no-figures")
    assert done.returncode == 0, done.stderr + done.stdout
    assert [(fault.kind, fault.target) for fault in read(tmp_path / "run").faults] == [("stop", 2), ("continue", 2)]


def test_a_fault_by_hand_is_no_accident(tmp_path: Path) -> None:
    with running(tmp_path / "run", "straight", "--set", "mission.leading.route_m=[[3.0, 0.0]]") as run:
        run.wait_for("leader_command")
        fleet = f"straight-{run.launcher.pid}"
        done = lfa("fault", "kill", "leader", "--fleet", fleet, "--json")
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["robot"] == 1
        assert run.launcher.wait(60.0) == 0
        assert [(fault.kind, fault.target) for fault in read(run.folder).faults] == [("kill", 1)]
        assert not [line for line in run.events() if line["kind"] == "died"]


def test_an_agent_that_dies_by_itself_is_named_and_the_run_goes_on(tmp_path: Path) -> None:
    with running(tmp_path / "run", "straight", *SHORT) as run:
        run.wait_for("leader_command")
        os.kill(run.group()["robot4"].pid, 9)
        eventually(lambda: any(line["kind"] == "died" for line in run.events()), "robot 4's death was not told")
        assert run.launcher.wait(60.0) == 0
        assert [robot.alive for robot in read(run.folder).robots] == [True, True, True, False]


def test_junk_on_every_key_stops_nobody(tmp_path: Path) -> None:
    """Random, empty, truncated, foreign and misdirected bytes: counted and dropped (seeded: 1)."""
    random = Random(1)
    with running(tmp_path / "run", "straight", *SHORT, "--robots", "2") as run:
        run.wait_for("leader_command")
        fleet = f"straight-{run.launcher.pid}"
        bus = ZenohBus(run.group()["router"].arguments[-1], Inbox())
        whole = encode(Clock(Header("sim", 1, 1, 0.0), 1.0))
        for owner in ("robot1", "robot2", "world", "witness", "operator", "sim", "robot99", "nobody"):
            for topic in TOPICS:
                to = "/all" if topic.name == "lease" else ""
                for payload in (b"", random.randbytes(40), whole[:-2], whole, b"\x91" * 30000):
                    if topic.type is not Clock or payload != whole:
                        bus.publish(f"lfa/{fleet}/{owner}/{topic.name}{to}", payload)
        assert run.launcher.wait(60.0) == 0
        bus.close()
        summary = read(run.folder)
        assert summary.outcome == "goal_reached"
        assert all(robot.alive for robot in summary.robots)
        log = (run.folder / "logs" / "recorder.log").read_text()
        assert re.search(r"\b[1-9]\d* undecodable", log), log
