"""Foxglove's own client on `lfa foxglove`: it decodes every channel, and its button hands over."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from pathlib import Path

import pytest

from tests.rigs.foreign_peers import answer, start
from tests.rigs.lfa_runs import LFA, eventually, lfa, running

pytestmark = pytest.mark.processes


def test_foxgloves_client_sees_the_fleet_and_hands_over(tmp_path: Path) -> None:
    with running(tmp_path / "run", "paper_path1", "--robots", "3") as run:
        run.wait_for("leader_command")
        words = [*LFA, "foxglove", "--port", "0", "--fleet", f"paper_path1-{run.launcher.pid}"]
        server = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            assert server.stdout is not None
            line = server.stdout.readline()
            address = re.search(r"ws://\S+", line)
            assert address is not None, line + server.communicate()[1]
            live = {"/tf", "/lfa/formation", "/diagnostics", "/lfa/leader", "/tf_static", "/robot1/trail"}
            live |= {f"/robot{n}/{topic}" for n in (1, 2, 3) for topic in ("odom", "scan", "pose")}
            frames = {f"robot{n}/{frame}" for n in (1, 2, 3) for frame in ("odom", "base_link")}
            wanted = json.dumps({"topics": sorted(live), "frames": sorted(frames)})
            client = start("foxglove", "foxglove_live.js", address[0], "/lfa/handover", wanted, home=tmp_path)
            told = json.loads(answer(client))
            assert live <= set(told["heard"])
            assert frames <= set(told["frames"])
            assert {"/lfa/stop", "/lfa/resume", "/lfa/handover", "/lfa/formation/column"} <= set(told["services"])
            assert told["called"]["success"], told["called"]
            assert re.fullmatch(r"robot [23] leads", told["called"]["message"])  # a loaded machine may change it before
            eventually(lambda: any(e.get("change") == "handed_over" for e in run.events()), "nobody handed over")
            server.send_signal(signal.SIGINT)
            assert server.wait(30.0) == 0
        finally:
            server.kill()
            server.communicate()


def test_the_layout_shows_map_robots_leader_errors_and_buttons(tmp_path: Path) -> None:
    path = tmp_path / "lfa.json"
    assert lfa("foxglove", "--layout", str(path)).returncode == 0
    layout = json.loads(path.read_text())
    panels = {name.partition("!")[0] for name in layout["configById"]}
    assert {"3D", "Plot", "RawMessages", "CallService", "DiagnosticSummary", "RosOut"} <= panels

    def shown(node: object) -> set[str]:
        return {node} if isinstance(node, str) else shown(node["first"]) | shown(node["second"])  # type: ignore[index]

    assert shown(layout["layout"]) == set(layout["configById"])
