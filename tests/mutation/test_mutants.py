"""The tool that puts faults into code finds what tests miss, and only that."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.mutation.mutate import mutants, planted
from tests.test_imports import ROOT

SOURCE = '''
def nearest(points, reach=1):
    """Return the nearest of points."""
    if not points or reach < 0:
        raise ValueError(f"{1 + 1}")
    return min(points)


class Counter:
    def add(self, more):
        self.total += more
'''


def test_each_kind_of_fault_has_the_name_of_its_function_and_messages_have_none() -> None:
    assert [mutant.name for mutant in mutants(SOURCE)] == [
        "nearest: if not points or reach < 0: -> if not points and reach < 0:",
        "nearest: if not points or reach < 0: -> if points or reach < 0:",
        "nearest: if not points or reach < 0: -> if not points or reach >= 0:",
        "nearest: if not points or reach < 0: -> if not points or reach < 1:",
        "nearest: return min(points) -> return max(points)",
        "Counter.add: self.total += more -> self.total -= more",
        "Counter.add: self.total += more -> pass",
    ]


def test_a_planted_fault_is_the_one_that_was_named() -> None:
    (fault,) = [mutant for mutant in mutants(SOURCE) if mutant.after == "return max(points)"]
    scope: dict[str, object] = {}
    exec(compile(planted(SOURCE, fault), "nearest.py", "exec"), scope)
    assert scope["nearest"]([1, 2]) == 2  # type: ignore[operator]


def test_faults_that_tests_miss_are_printed_and_those_that_they_see_are_not(tmp_path: Path) -> None:
    blind = tmp_path / "test_blind.py"
    blind.write_text(
        "from lfa.protocol.geometry import STILL, slowed\n\n\ndef test_slowed():\n    assert slowed(STILL, 1.0)\n"
    )
    lines = (ROOT / "protocol" / "geometry.py").read_text().splitlines()
    line = next(number for number, text in enumerate(lines, 1) if "return twist if share >= 1.0" in text)
    sharp = tmp_path / "test_sharp.py"
    sharp.write_text(
        "from lfa.protocol.geometry import Twist, slowed\n\n\n"
        "def test_slowed():\n    assert slowed(Twist(2.0, 4.0), 1.0) == Twist(1.0, 2.0)\n"
    )
    words = [sys.executable, "-m", "tests.mutation", "protocol/geometry.py", "--lines", str(line), "--tests"]
    for tests, exit_code, survivors in ((blind, 1, 3), (sharp, 0, 0)):
        ran = subprocess.run([*words, str(tests)], cwd=ROOT, capture_output=True, text=True, check=False)
        assert ran.returncode == exit_code, ran.stdout + ran.stderr
        assert ran.stdout.count("survived  protocol/geometry.py:") == survivors, ran.stdout
        assert "protocol/geometry.py: 3 of 3 killed" in ran.stdout or survivors
