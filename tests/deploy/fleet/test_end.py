"""What ends a machine's part: it reads the plan as the other programs there do, and loads little."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from lfa.deploy.fleet.host.end import ANSWER, OTHER_ENGINE
from lfa.deploy.fleet.host.start_check import Found
from lfa.deploy.fleet.plan import host_plan
from lfa.deploy.fleet.plan.fleet_file import load

FLEET = 'fleet = "f"\nscenario = "straight"\nteam = 2\nhosts.a.address = "localhost"\n'


def ended(folder: Path, engine: str) -> subprocess.CompletedProcess[str]:
    """Run the program for a machine on which nothing runs, and whose last plan has `engine`."""
    (folder / "fleet.toml").write_text(FLEET)
    part = host_plan.parts(load(folder / "fleet.toml"), "run", "digest")["a"]
    part = msgspec.structs.replace(part, state=str(folder))
    (folder / host_plan.PART).write_bytes(msgspec.json.encode(msgspec.structs.replace(part, engine=engine)))
    program = [sys.executable, "-P", "-m", "lfa.deploy.fleet.host.end"]
    given = msgspec.json.encode(part).decode()
    return subprocess.run(program, input=given, capture_output=True, text=True, timeout=30, check=False)


def test_it_answers_as_the_program_does_that_starts_a_machine(tmp_path: Path) -> None:
    done = ended(tmp_path, "own")
    assert done.returncode == 0, done.stderr
    found = msgspec.json.decode(done.stdout.removeprefix(ANSWER), type=Found)
    assert (found.run, found.digest) == ("", "")


def test_units_of_systemd_are_left_to_who_knows_them(tmp_path: Path) -> None:
    assert ended(tmp_path, "systemd").returncode == OTHER_ENGINE


@pytest.mark.parametrize("given", ["", "{}", "[1]", '{"state": 3}'])
def test_a_damaged_plan_is_refused_in_a_line(given: str) -> None:
    program = [sys.executable, "-P", "-m", "lfa.deploy.fleet.host.end"]
    done = subprocess.run(program, input=given, capture_output=True, text=True, timeout=30, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


def test_it_loads_neither_transport_nor_scenarios() -> None:
    code = "import sys, lfa.deploy.fleet.host.end as end; print([m for m in sys.modules if m in %r])"
    heavy = ("zenoh", "lfa.world", "lfa.agents", "typer", "lfa.deploy.fleet.plan.host_plan")
    done = subprocess.run([sys.executable, "-P", "-c", code % (heavy,)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
