"""A plug-in that does not return is left after Ctrl-C, and its run folder is whole."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfa.agents.following.plugin import add_controller_file
from lfa.deploy.simulate import run

CODE = """
import os, signal, time

class Hangs:
    def __init__(self, gains, limits): ...
    def reset(self, own_pose, own_twist): ...
    def step(self, reference, own_pose, own_twist, dt):
        os.kill(os.getpid(), signal.SIGINT)
        {hangs}
"""


@pytest.mark.parametrize("hangs", ["time.sleep(1000.0)", "while True: pass"])
def test_ctrl_c_leaves_a_controller_that_does_not_return_and_says_where_it_was(tmp_path: Path, hangs: str) -> None:
    (tmp_path / "own.py").write_text(CODE.format(hangs=hangs))
    name = add_controller_file(f"{tmp_path}/own.py:Hangs")
    done = run("straight", robots=2, set=[f'mission.following.controller="{name}"'], out=tmp_path / "run")
    assert done.summary.outcome == "interrupted"
    assert done.summary.reason == "SIGINT in own.py:9, which did not return"
    assert {"events.jsonl", "recording.mcap", "summary.json"} <= {path.name for path in (tmp_path / "run").iterdir()}
