"""E33 and E34 on processes: a spare that `lfa run` starts joins, and the leader retires, while the team drives."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.rigs.lfa_runs import Running, lfa, running

pytestmark = pytest.mark.processes

SPARE = "world.spares=[{id=7, start=[-3.0, -2.0, 0.0]}]"


def _said(run: Running, *words: str) -> tuple[int, str]:
    agent = run.group()["robot1"].arguments
    done = lfa(*words, "--fleet", agent[agent.index("--fleet") + 1])
    return done.returncode, (done.stdout + done.stderr).strip()


def test_e33_e34_a_spare_joins_and_the_leader_retires_while_the_team_drives(tmp_path: Path) -> None:
    with running(tmp_path / "run", "straight", "--robots", "3", "--set", SPARE) as run:
        run.wait_for("leader_command")
        assert _said(run, "join", "2") == (2, "lfa: join 2: this id is in use, must be none of [1, 2, 3]")
        unheard = "nobody of this id is heard, must run first: lfa-agent --id 9 --spare"
        assert _said(run, "join", "9") == (2, f"lfa: join 9: {unheard}")
        assert _said(run, "join", "-1") == (2, "lfa: join -1: must be a robot's id, from 1 to 2147483648")
        assert _said(run, "join", "7") == (0, "join: robot7 is in the team; the chain is [1, 2, 3, 7]")
        assert _said(run, "retire", "1") == (0, "retire: robot1 is out of the team; the chain is [2, 3, 7]")
        assert _said(run, "retire", "9") == (2, "lfa: retire 9: not in the team, must be one of [2, 3, 7]")
