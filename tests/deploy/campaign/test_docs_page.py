"""The page "Campaigns": each of its commands runs, in its order, with fewer and shorter runs."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from lfa.deploy.cli import build
from tests.test_imports import ROOT

PAGE = (ROOT / "deploy" / "docs" / "campaigns.md").read_text()
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
COMMANDS = [line for language, block in BLOCKS if not language for line in block.splitlines()]
ON_A_CLUSTER = [command for command in COMMANDS if "--on" in command]
"""Commands whose engines `test_engines.py` starts."""
PLAN = next(block for language, block in BLOCKS if language == "toml")
SMALLER = {"time_limit_s=10": "time_limit_s=1", "1..100": "1..2"}

SHORTER = {"1..50": "1..1", "time_limit_s = 15": "time_limit_s = 1", "at 6 s": "at 0 s", "[0.8, 1.2]": "[0.8]"}


def test_the_engines_of_the_page_are_those_that_a_test_starts() -> None:
    text = (ROOT / "tests" / "deploy" / "campaign" / "test_engines.py").read_text()
    named = [re.search(r"--on (\w+)", command) for command in ON_A_CLUSTER]
    assert [found[1] for found in named if found and found[1] in text] == ["slurm", "dask", "kubernetes"]


def test_every_command_of_the_page_runs_in_its_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = f"robots = 2\n{PLAN}"
    for old, new in SHORTER.items():
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "plan.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    assert len({re.sub(r"^lfa (\w+( merge)?).*", r"\1", command) for command in COMMANDS}) == 3
    for command in (command for command in COMMANDS if command not in ON_A_CLUSTER):
        words = [SMALLER.get(word, word) for word in shlex.split(command)[1:]]
        more = ["--robots", "2", *([] if "--seeds" in words else ["--no-figures"])] if words[0] == "sim" else []
        assert build(words[:1])([*words, *more], standalone_mode=False) == 0, command
    first = (tmp_path / "runs" / "plan" / "merged" / "results.csv").read_bytes()
    assert (tmp_path / "runs" / "both" / "results.csv").read_bytes() == first, "shares merge to the same table"


TWO_RUNS = """scenario = "circle"
seeds = "1..2"
robots = 1
[set]
time_limit_s = 1
[assert]
goal_reached = false
"""


def _recipe(language: str, word: str) -> str:
    return next(block for name, block in BLOCKS if name == language and word in block)


@pytest.mark.parametrize(("language", "word"), [("sh", "#SBATCH"), ("sh", "parallel"), ("yaml", "matrix")])
def test_a_recipe_has_ten_lines_at_most(language: str, word: str) -> None:
    assert len(_recipe(language, word).splitlines()) <= 10


def test_the_recipes_of_slurm_parallel_and_github_do_their_shares_of_one_campaign(tmp_path: Path) -> None:
    """Of two runs the first is done by what GNU parallel starts, the second by the array's script; both by a matrix."""
    (tmp_path / "plan.toml").write_text(TWO_RUNS)
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    (tmp_path / ".venv" / "bin" / "activate").write_text("")
    (tmp_path / ".venv" / "bin" / "lfa").symlink_to(Path(sys.executable).with_name("lfa"))
    search = f"{Path(sys.executable).parent}:{os.environ['PATH']}"

    def does(script: str, **more: str) -> None:
        done = subprocess.run(["sh", "-c", script], cwd=tmp_path, env={**os.environ, "PATH": search, **more},
                              capture_output=True, text=True, timeout=120, check=False)  # fmt: skip
        assert done.returncode == 0, f"{script}\n{done.stderr}"

    of_parallel = re.sub(r"\\\n *", "", _recipe("sh", "parallel"))
    started = re.search(r"(\.venv/bin/lfa .*) ::: ", of_parallel)
    assert started is not None
    does(started[1].replace("{}", "1"))
    does(_recipe("sh", "#SBATCH"), SLURM_SUBMIT_DIR=str(tmp_path), SLURM_ARRAY_TASK_ID="2")
    of_github = re.search(r"run: (lfa campaign .*)", _recipe("yaml", "matrix"))
    assert of_github is not None
    for shard in ("1", "2"):
        does(of_github[1].replace("${{ matrix.shard }}", shard))
    does("lfa campaign merge runs/plan; lfa campaign merge results")
    tables = [(tmp_path / folder / "merged" / "results.csv").read_bytes() for folder in ("runs/plan", "results")]
    assert tables[0] == tables[1]
    assert len(tables[0].splitlines()) == 1 + 2
