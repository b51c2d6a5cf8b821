"""What a person or a test can see of a fleet of real processes, while it runs and afterwards."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from socket import socket
from urllib.request import urlopen

from lfa.deploy.recording import mcap_reader
from lfa.deploy.recording.recorder import parts
from lfa.protocol import clock
from lfa.protocol.transport.zenoh_config import answers
from tests.rigs.lfa_runs import LFA, eventually, lfa, running
from tests.rigs.recording_agreement import differing

STOPPED_S = 3.0


@contextmanager
def router(endpoint: str) -> Iterator[None]:
    process = subprocess.Popen([sys.executable, "-P", "-m", "lfa.deploy.fleet.host.router", "--listen", endpoint])
    try:
        eventually(lambda: answers(endpoint), "no router came up")
        yield
    finally:
        process.kill()
        process.wait()


def test_every_core_returns_the_same_again(tmp_path: Path) -> None:
    faults = ("--fault", "stop 3 at 1 s for 0.3 s", "--fault", "kill leader at 2 s", "--fault", "restart 1 at 3 s")
    folder = str(tmp_path / "run")
    lfa("run", "paper_path1", "--set", "time_limit_s=6.0", *faults, "--out", folder, "--no-figures")
    again = lfa("replay", folder, "--robot", "all")
    assert again.returncode == 0, again.stdout + again.stderr
    assert len(again.stdout.splitlines()) == 7, "five lives of four robots, the witness and the world"
    assert differing(Path(folder), killed=("robot1",)) == [], (
        "first and last message of each topic: recording against journals"
    )
    recording = json.loads((Path(folder) / "summary.json").read_text())["recording"]
    assert recording["messages"] > 3000
    assert recording["dropped"] == 0


def test_a_fleet_in_real_time_is_not_stepped_and_one_line_says_so(tmp_path: Path) -> None:
    with running(tmp_path / "run", "straight", "--robots", "1") as run:
        run.wait_for("leader_command")
        fleet = f"straight-{run.launcher.pid}"
        done = lfa("step", "5", "--fleet", fleet)
    [line] = done.stderr.splitlines()
    assert done.returncode == 2 and line.startswith(f"lfa: fleet {fleet} runs in real time: "), line


def test_an_operator_sees_a_fleet_and_changes_its_formation(tmp_path: Path) -> None:
    with running(tmp_path / "run", "straight", "--robots", "3") as run:
        run.wait_for("leader_command")
        fleet = ("--fleet", f"straight-{run.launcher.pid}")
        watched = json.loads(lfa("watch", "--json", *fleet).stdout)
        assert [row["role"] for row in watched["robots"]] == ["leader", "follower", "follower"]
        assert "leader" in lfa("watch", "--once", *fleet).stdout

        heard = json.loads(lfa("topic", "echo", "robot2/pose", "--count", "1", *fleet).stdout)
        assert (heard["channel"], heard["message"]["header"]["sender"]) == ("robot2/pose", "robot2")
        rates = {
            rate["channel"]: rate["hz"] for rate in json.loads(lfa("topic", "hz", "pose", "--json", *fleet).stdout)
        }
        assert set(rates) == {"robot1/pose", "robot2/pose", "robot3/pose"}

        asked = lfa("formation", "column", *fleet)
        assert asked.returncode == 0, asked.stdout + asked.stderr
        assert "ordered by robot1" in asked.stdout
        assert [line["side"] for line in run.events() if line.get("by") == "operator"] == ["column"]


def test_a_recording_played_back_is_seen_like_a_fleet(tmp_path: Path) -> None:
    folder, endpoint = str(tmp_path / "run"), f"unixsock-stream/{tmp_path}/r.sock"
    lfa("sim", "straight", "--set", "time_limit_s=20.0", "--out", folder, "--no-figures")
    with router(endpoint):
        player = subprocess.Popen([*LFA, "replay", folder, "--connect", endpoint], stdout=subprocess.DEVNULL)
        try:
            heard = lfa("topic", "echo", "robot2/pose", "--count", "1", "--fleet", "replay", "--connect", endpoint)
        finally:
            player.kill()
            player.wait()
    assert json.loads(heard.stdout)["message"]["type"] == "pose"


def test_a_viewer_comes_and_goes_and_the_run_goes_on(tmp_path: Path) -> None:
    with running(tmp_path / "run", "straight", "--robots", "2", "--set", "mission.leading.route_m=[[6.0, 0.0]]") as run:
        run.wait_for("leader_command")
        port, web_port = free_port(), free_port()
        where = ("--fleet", f"straight-{run.launcher.pid}", "--port", str(port), "--web-port", str(web_port))
        viewer = subprocess.Popen([*LFA, "view", "--serve-web", *where], stdout=subprocess.PIPE, text=True)
        try:
            assert viewer.stdout is not None
            assert viewer.stdout.readline().startswith(f"http://127.0.0.1:{web_port}?url=")
            with urlopen(f"http://127.0.0.1:{web_port}/") as page:
                assert b"rerun" in page.read().lower()
            seen = mcap_reader.read(run.folder).end_s
            eventually(lambda: mcap_reader.read(run.folder).end_s > seen + 0.5, "the run stands")
        finally:
            viewer.kill()
            viewer.wait()
        assert run.launcher.wait(60.0) == 0
        assert run.summary()["outcome"] == "goal_reached"
        assert run.summary()["recording"]["dropped"] == 0


def free_port() -> int:
    with socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def test_what_is_not_there_is_said_in_one_line() -> None:
    for arguments in (["watch", "--once"], ["topic", "list"], ["formation", "left"]):
        done = lfa(*arguments, "--fleet", "nobody", "--connect", "unixsock-stream//nonexistent/r.sock")
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert "no router answers at" in done.stderr
    piped = lfa("watch")
    assert (piped.returncode, piped.stderr) == (2, "lfa: watch needs a terminal: use --once or --json\n")
    assert lfa("formation", "circle").stderr == "lfa: formation = circle: must be one of left, right, column, zigzag\n"


def test_a_running_fleet_can_be_recorded_from_outside(tmp_path: Path) -> None:
    with running(tmp_path / "run", "straight", "--robots", "2") as run:
        run.wait_for("leader_command")
        fleet, out, cut = f"straight-{run.launcher.pid}", tmp_path / "outside", tmp_path / "cut"
        recorder = subprocess.Popen([*LFA, "record", "--fleet", fleet, "--out", str(cut)], stdout=subprocess.DEVNULL)
        split = ("--split-mb", "0.02", "--out", str(out))
        done = lfa("record", "--fleet", fleet, "--seconds", "3", *split)
        eventually(lambda: cut.is_dir() and mcap_reader.read(cut).end_s > 0.0, "nothing was recorded")
        killed_at = mcap_reader.read(run.folder).end_s
        eventually(lambda: mcap_reader.read(run.folder).end_s > killed_at, "the run stands")
        recorder.kill()
        recorder.wait()
    assert done.returncode == 0, done.stdout + done.stderr
    assert ", 0 lost, " in done.stdout
    assert len(parts(out)) > 1
    assert set(mcap_reader.read(out).truth) == {1, 2}
    assert (out / "scenario.toml").is_file()
    assert mcap_reader.read(cut).end_s > killed_at - 1.1, "SIGKILL may cost the last second, no more"
    again = lfa("replay", str(out), "--robot", "all")
    assert again.returncode == 0, again.stdout + again.stderr
    assert {line.split("-")[0] for line in again.stdout.splitlines()} == {"robot1", "robot2", "witness", "world"}


def test_a_recording_that_missed_messages_says_how_many_and_when(tmp_path: Path) -> None:
    """The recorder is stopped for longer than its link lives without it."""
    with running(tmp_path / "run", "straight", "--robots", "2", "--set", "mission.leading.cruise_mps=0.1") as run:
        run.wait_for("leader_command")
        out = tmp_path / "outside"
        words = [*LFA, "record", "--fleet", f"straight-{run.launcher.pid}", "--seconds", "9", "--out", str(out)]
        recorder = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        eventually(lambda: out.is_dir() and mcap_reader.read(out).end_s > 0.0, "nothing was recorded")
        recorder.send_signal(signal.SIGSTOP)
        clock.sleep(STOPPED_S)
        recorder.send_signal(signal.SIGCONT)
        told, warned = recorder.communicate(timeout=60)
    assert told.rstrip().endswith(", with holes"), told + warned
    assert ", 0 lost, " not in told
    assert "never arrived, between " in warned
