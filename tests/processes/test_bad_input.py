"""Bad input gets one line that says what, where and what would be right, exit code 2, and nothing is left behind."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.rigs.lfa_runs import lfa

pytestmark = pytest.mark.processes

#     arguments                                                   what the line must name
TABLE = (
    (("run", "nowhere"),                                          "nowhere"),
    (("run", "nowhere.toml"),                                     "nowhere.toml"),
    (("run", "straight", "--set", "mission.leeding.cruise=1"),    "leading"),
    (("run", "straight", "--set", "world.body.mass_kg=-1"),       "world.body.mass_kg"),
    (("run", "straight", "--set", "mission.robots=[1, 1]"),       "mission.robots"),
    (("run", "straight", "--robots", "0"),                        "--robots"),
    (("run", "straight", "--robots", "two"),                      "--robots"),
    (("run", "straight", "--seed"),                               "--seed"),
    (("run", "straight", "--lockstep", "--speed", "-1"),          "--speed -1"),
    (("run", "straight", "--lockstep", "--step", "0"),            "--step 0"),
    (("run", "straight", "--speed", "2"),                         "--lockstep"),
    (("diff", "nowhere", "nowhere"),                              "nowhere"),
    (("step", "0"),                                               "ticks 0"),
    (("run", "straight", "--fault", "kill 9 at 3 s"),             "1, 2, 3, 4"),
    (("run", "straight", "--fault", "tickle leader at 3 s"),      "kill leader at 20 s"),
    (("run", "straight", "--fault", "kill leader"),               "kill leader at 20 s"),
    (("run", "straight", "--fault", "restart leader at 3 s"),     "restart"),
    (("run", "straight", "--set", 'faults=["kill 9 at 3 s"]'),    "faults[0]"),
    (("run", "straight", "--out", "/proc/no/such/place"),         "--out"),
    (("sim", "nowhere"),                                          "nowhere"),
    (("sim", "straight", "--robots", "0"),                        "--robots"),
    (("sim", "straight", "--out", "/proc/no/such/place"),         "--out"),
    (("validate", "straight", "--set", "time_limit_s=-1"),        "time_limit_s"),
    (("plot", "nowhere"),                                         "nowhere"),
    (("bench", "nothing"),                                        "lidar"),
    (("fault", "tickle", "leader"),                               "kill"),
    (("fly",),                                                    "fly"),
    (("list", "--colour"),                                        "--colour"),
)  # fmt: skip


@pytest.mark.parametrize(("arguments", "named"), TABLE, ids=[" ".join(arguments) for arguments, _ in TABLE])
def test_bad_input_is_refused_in_one_line(
    arguments: tuple[str, ...], named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = lfa(*arguments)
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1, done.stderr
    assert named in done.stderr
    assert list(tmp_path.iterdir()) == [], "something half-made was left behind"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("lfa.deploy.fleet.host.router", "--listen", "carrier-pigeon"), "carrier-pigeon"),
        (("lfa.deploy.fleet.host.router", "--listen", "tcp/203.0.113.7:7447"), "203.0.113.7"),
        (("lfa.world.cli", "nowhere"), "nowhere"),
        (("lfa.agents.cli", "--role", "boss", "--id", "1"), "boss"),
        (("lfa.agents.cli", "--role", "follower", "--id", "0"), "--id 0"),
    ],
)
def test_each_process_refuses_bad_input_in_one_line(arguments: tuple[str, ...], named: str) -> None:
    command = [sys.executable, "-m", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20.0, check=False)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert named in done.stderr
