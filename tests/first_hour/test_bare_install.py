"""With nothing but the base installed, a command works, or says what it needs before it does anything."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from lfa.deploy.fleet.doctor import EXTRAS, PURPOSES
from tests.test_imports import ROOT

LFA = Path(sys.executable).with_name("lfa")
BARE = Path(__file__).parent / "bare"


def bare(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run `lfa` with `words` in `folder`, without the packages of the extras."""
    there = os.environ | {"PYTHONPATH": str(BARE), "TMPDIR": str(folder)}
    return subprocess.run([str(LFA), *words], cwd=folder, env=there, capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize("words", [("list",), ("doctor",), ("validate", "straight"), ("schema",)])
def test_what_the_base_can_do_it_does(tmp_path: Path, words: tuple[str, ...]) -> None:
    done = bare(tmp_path, *words)
    assert done.returncode == 0, done.stderr


def test_the_doctor_says_that_a_bare_machine_is_healthy_and_how_to_get_more(tmp_path: Path) -> None:
    done = bare(tmp_path, "doctor", "--json")
    found = json.loads(done.stdout)
    assert done.returncode == 0
    assert found["ok"]
    says = {one["check"]: one["says"] for one in found["findings"]}
    assert says["[world]"] == "not here, for simulated worlds: pip install 'lfa[world]'"
    assert says["router"] == "no router: none is needed for run, sim, up" or says["router"].endswith("answers")


def test_the_doctor_knows_every_extra_that_a_user_may_want() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert set(EXTRAS) == set(PURPOSES) == set(extras) - {"all", "test", "docs"}


@pytest.mark.parametrize(
    ("words", "extras"),
    [
        (("sim", "straight"), "world,view"),
        (("run", "straight"), "world,view"),
        (("report", "runs/none"), "view"),
        (("view", "runs/none"), "view"),
        (("record", "--seconds", "1"), "view"),
        (("up", "fleet.toml"), "deploy"),
        (("watch", "--once"), "deploy"),
        (("bag", "runs/none"), "ros,view"),
        (("why", "runs/none"), "view"),
        (("replay", "runs/none"), "world,view"),
        (("campaign", "plan.toml"), "world,view"),
        (("bench", "lidar"), "world,view"),
    ],
)
def test_a_command_that_needs_an_extra_says_so_before_it_does_anything(
    tmp_path: Path, words: tuple[str, ...], extras: str
) -> None:
    done = bare(tmp_path, *words)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"lfa: {words[0]} needs ")
    assert line.endswith(f"install with: pip install 'lfa[{extras}]'")
    assert list(tmp_path.iterdir()) == []


def test_with_json_the_missing_extra_is_json(tmp_path: Path) -> None:
    done = bare(tmp_path, "sim", "straight", "--json")
    (error,) = json.loads(done.stdout)["errors"]
    assert error["text"].startswith("sim needs numpy")
