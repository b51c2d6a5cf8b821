"""What lies on PYTHONPATH adds to what is installed, and stands in for none of it."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
FIRST = "import lfa.protocol.program_start.installed_first"
PROGRAMS = sorted(
    ".".join(("lfa", *path.relative_to(ROOT).with_suffix("").parts))
    for package in ("agents", "world", "deploy")
    for path in (ROOT / package).rglob("*.py")
    if FIRST in path.read_text()
)
AT_START = "import runpy, re, sys; print(*sys.modules)"
"""Modules that Python imports before a program is asked."""
INSTALLED = {"msgspec", "zenoh", "typer", "numpy", "yaml", "random", "world", "agents", "protocol", "deploy"}


def _ran(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", *words]
    env = os.environ | {"PYTHONPATH": str(folder)}
    return subprocess.run(command, env=env, capture_output=True, text=True, check=False, timeout=60)


@pytest.fixture(scope="module")
def traps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a module, which ends its program, of each name that Python does not import by itself."""
    folder = tmp_path_factory.mktemp("traps")
    loaded = _ran(folder, "-c", AT_START).stdout.split()
    here = {name for name in sys.stdlib_module_names if find_spec(name)}
    for name in (here | INSTALLED) - {"__future__", *loaded}:
        (folder / f"{name}.py").write_text(f"raise SystemExit('trapped by {name}')")
    return folder


def test_every_program_is_among_them() -> None:
    assert {"lfa.deploy.cli", "lfa.agents.cli", "lfa.world.cli", "lfa.deploy.robot.cli"} < set(PROGRAMS)
    assert {f"lfa.deploy.fleet.host.{name}" for name in ("router", "supervisor", "guardian", "host")} < set(PROGRAMS)


@pytest.mark.parametrize("program", PROGRAMS)
def test_modules_on_pythonpath_stand_in_for_none_of_a_programs(program: str, traps: Path) -> None:
    done = _ran(traps, "-c", f"import {program}; print('imported')")
    assert (done.stdout, done.stderr) == ("imported\n", "")


def test_nor_for_what_a_command_imports_later(traps: Path) -> None:
    done = _ran(traps, "-c", "from lfa.deploy.cli import main; main()", "validate", "paper_path1")
    assert "ok" in done.stdout, done.stdout + done.stderr


def test_a_plug_in_on_pythonpath_is_found(traps: Path) -> None:
    (traps / "of_my_own.py").write_text("print('mine')")
    assert _ran(traps, "-c", "import lfa.agents.cli, of_my_own").stdout == "mine\n"


def test_what_python_imported_from_there_before_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "random.py").write_text("VALUES = [1, 2, 3]")
    done = _ran(tmp_path, "-c", "import random, lfa.deploy.cli")
    assert done.returncode == 2
    assert done.stderr.startswith(f"lfa: {tmp_path / 'random.py'}: hides a module of Python's own")
    assert len(done.stderr.splitlines()) == 1


def test_a_script_of_a_users_own_keeps_its_order(tmp_path: Path) -> None:
    done = _ran(tmp_path, "-c", "import lfa.deploy.simulate, sys; print(sys.path[0])")
    assert done.stdout.strip() == str(tmp_path), done.stderr
