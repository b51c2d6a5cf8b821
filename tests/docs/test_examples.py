"""The numbered examples: short, in virtual time, and each does what its first line says."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from lfa.agents.behaviors.own_behavior import BEHAVIORS
from lfa.agents.following.controller import CONTROLLERS
from lfa.world.description.own_sensor import SENSORS
from tests.test_imports import ROOT

FOLDER = ROOT / "deploy" / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
LINES_MAX = 40

#   example                what it prints, as patterns
SHOWN: dict[str, tuple[str, ...]] = {
    "01_first_run":        (r"goal_reached", r"robot 2 leads from 5\.\d+ s on \(kill\)", r"robot 2 holds the lease"),
    "02_own_controller":   (r"law +goal_reached", r"carrot +goal_reached"),
    "03_own_scenario":     (r"ok +contacts_max 0", r"robot1: (left|right) a side is free"),
    "04_sweep":            (r"K = 0\.8", r"K = 1\.5", r"sweep\.png"),
    "05_read_recording":   (r"robot 3: \d+ poses", r"events: \{'start': 1"),
    "06_driver":           (r"goal_reached: robot 2 was driven from \(-0\.6, 1\.04\) to \(3\.\d+, 1\.\d+\)",),
    "07_faults":           (r"injected: stop 1 at", r"led by robots 1, 2", r" 0 violations"),
    "08_formation_change": (r"asks for a column", r"robot 3: its slot moves until", r"path\.png"),
    "09_own_generator":    (r"seed 1: goal_reached past posts at \(3, \S+\), \(6, \S+\)", r"seed 2: goal_reached"),
    "10_own_sensor":       (r"law +goal_reached, last reading .*: \(12\.\d+, {'lux': \S+}\)", r"careful +goal"),
    "11_learn":            (r"gains 0\.00, 0\.00: -9\.", r"best: .* with -0\.9"),
    "12_own_behavior":     (r"\[\] +goal_reached after 1\d s", r"\['cautious'\] +goal_reached after [23]\d s"),
    "13_learned_controller": (r"imitates its teacher to 0\.\d\d", r"goal_reached, distance error .* [1-6]\d mm"),
}  # fmt: skip


def test_the_examples_are_numbered_and_each_is_known_here() -> None:
    assert [path.stem for path in EXAMPLES] == list(SHOWN)
    assert [int(path.stem[:2]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_read_at_a_glance(path: Path) -> None:
    assert len(path.read_text().splitlines()) < LINES_MAX


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_does_what_it_says(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [str(path)])
    for kind in (CONTROLLERS, BEHAVIORS, SENSORS):
        monkeypatch.setattr(kind, "_added", {})
    runpy.run_path(str(path), run_name="__main__")
    shown = capsys.readouterr().out
    assert [pattern for pattern in SHOWN[path.stem] if not re.search(pattern, shown)] == [], shown
