"""The wheel, built and installed into fresh environments: only `lfa` is importable, and the commands run."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.test_imports import PACKAGES, ROOT

INSTALL_S_MAX = 600
PIP = ("-m", "pip", "--quiet", "--disable-pip-version-check")
FLAT = "import importlib.util as u; print([n for n in ('agents', 'world', 'protocol', 'deploy') if u.find_spec(n)])"

pytestmark = [pytest.mark.processes, pytest.mark.wheel]


def _ran(*words: str | Path, cwd: Path) -> str:
    done = subprocess.run(
        [*map(str, words)], cwd=cwd, capture_output=True, text=True, timeout=INSTALL_S_MAX, check=False
    )
    assert done.returncode == 0, f"{' '.join(map(str, words))}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("wheel")
    _ran(sys.executable, *PIP, "wheel", "--no-deps", "--wheel-dir", place, ROOT, cwd=place)
    return next(place.glob("lfa-*.whl"))


def _environment(place: Path, wheel: Path, extra: str) -> Path:
    """Install the wheel with `extra` into a new environment; return its folder of commands."""
    _ran(sys.executable, "-m", "venv", place / "venv", cwd=place)
    commands = place / "venv" / "bin"
    _ran(commands / "python", *PIP, "install", "-c", ROOT / "constraints.txt", f"{wheel}{extra}", cwd=place)
    return commands


def test_the_wheel_says_that_its_packages_have_types(wheel: Path) -> None:
    packed = set(zipfile.ZipFile(wheel).namelist())
    assert {f"lfa/{package}/py.typed" for package in PACKAGES} <= packed


def test_the_base_install_has_an_agent_and_no_flat_name(wheel: Path, tmp_path: Path) -> None:
    commands = _environment(tmp_path, wheel, "")
    assert "--role" in _ran(commands / "lfa-agent", "--help", cwd=tmp_path)
    assert "lfa run" in _ran(commands / "lfa", "--help", cwd=tmp_path)
    assert _ran(commands / "lfa", "--version", cwd=tmp_path) == f"lfa {wheel.name.split('-')[1]}\n"
    assert _ran(commands / "python", "-P", "-c", FLAT, cwd=tmp_path).strip() == "[]"
    heavy = _ran(commands / "python", "-P", "-c", FLAT.replace("'agents'", "'numpy', 'rerun', 'pymunk'"), cwd=tmp_path)
    assert heavy.strip() == "[]"


def test_with_its_extras_it_simulates_and_runs(wheel: Path, tmp_path: Path) -> None:
    commands = _environment(tmp_path, wheel, "[world,view,deploy]")
    short = ("straight", "--robots", "2", "--set", "mission.leading.route_m=[[1.0, 0.0]]", "--no-figures")
    (tmp_path / "world.py").write_text("raise SystemExit('a file beside the user')\n")
    for action in ("sim", "run"):
        _ran(commands / "lfa", action, *short, "--out", tmp_path / action, cwd=tmp_path)
        assert (tmp_path / action / "summary.json").is_file()
