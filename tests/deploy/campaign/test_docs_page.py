"""The page "Campaigns": each of its commands runs, in its order, with fewer and shorter runs."""

from __future__ import annotations

import re
import shlex
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
