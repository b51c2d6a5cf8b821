"""What a person or a test can see of a fleet of real processes, while it runs and afterwards."""

from __future__ import annotations

from pathlib import Path

from tests.processes.fleet import lfa


def test_every_core_returns_the_same_again(tmp_path: Path) -> None:
    faults = ("--fault", "stop 3 at 1 s for 0.3 s", "--fault", "kill leader at 2 s", "--fault", "restart 1 at 3 s")
    folder = str(tmp_path / "run")
    lfa("run", "paper_path1", "--set", "time_limit_s=6.0", *faults, "--out", folder, "--no-figures")
    again = lfa("replay", folder, "--robot", "all")
    assert again.returncode == 0, again.stdout + again.stderr
    assert len(again.stdout.splitlines()) == 7, "five lives of four robots, the witness and the world"
