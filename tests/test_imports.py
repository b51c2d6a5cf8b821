"""Who may import whom, as a table, and what a robot's process must never load."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("protocol", "agents", "world", "deploy")

#           package      may import of ours
MAY: dict[str, set[str]] = {
    "protocol": {"protocol"},
    "agents":   {"protocol", "agents"},
    "world":    {"protocol", "world"},
    "deploy":   {"protocol", "agents", "world", "deploy"},
}  # fmt: skip

#           module       only imported by (within these packages)
ONLY: dict[str, tuple[set[str], tuple[str, ...]]] = {
    "zenoh":    ({"protocol/transport/zenoh_bus.py"}, PACKAGES),
    "time":     ({"protocol/clock.py"},     ("protocol", "agents")),
    "rerun":    (set(),                     ("protocol", "agents", "world")),
}  # fmt: skip

NEVER_ON_A_ROBOT = ("numpy", "pymunk", "rerun", "numba", "matplotlib", "mcap", "rich", "world", "deploy")
BASE = {"msgspec", "typer", "zenoh"}


def _imports(path: Path) -> set[str]:
    """Top-level names of everything that the file imports, wherever in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            names.add((node.module or "").split(".")[0])
    return names


def _files(*packages: str) -> list[Path]:
    return [path for package in packages for path in sorted((ROOT / package).rglob("*.py"))]


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_go_one_way(package: str) -> None:
    for path in _files(package):
        foreign = (_imports(path) & set(PACKAGES)) - MAY[package]
        assert not foreign, f"{path.relative_to(ROOT)} imports {foreign}; {package} may import {MAY[package]}"


@pytest.mark.parametrize("module", ONLY)
def test_a_module_with_one_door_has_one_door(module: str) -> None:
    allowed, packages = ONLY[module]
    users = {str(path.relative_to(ROOT)) for path in _files(*packages) if module in _imports(path)}
    assert users <= allowed, f"{module} is imported by {users - allowed}"


@pytest.mark.parametrize("package", ["protocol", "agents"])
def test_protocol_and_agents_need_no_more_than_the_base(package: str) -> None:
    for path in _files(package):
        third = {name for name in _imports(path) if name not in sys.stdlib_module_names} - set(PACKAGES) - {""}
        assert third <= BASE, f"{path.relative_to(ROOT)} imports {third - BASE}, which a robot does not install"


def _loaded(code: str, unwanted: tuple[str, ...]) -> str:
    """Which of `unwanted` a fresh interpreter has loaded after `code`."""
    code = f"{code}; import sys; print([name for name in {unwanted} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=True)
    return done.stdout.strip()


def test_an_agents_process_loads_nothing_heavy() -> None:
    assert _loaded("import lfa.agents.cli", NEVER_ON_A_ROBOT) == "[]"


def test_what_runs_on_every_machine_of_a_fleet_needs_no_more_than_the_base() -> None:
    code = "import lfa.deploy.fleet.host.host, lfa.deploy.fleet.host.supervisor, lfa.deploy.fleet.host.router"
    assert _loaded(code, (*NEVER_ON_A_ROBOT[:-2], "asyncssh", "cryptography")) == "[]"


def test_help_loads_no_command() -> None:
    heavy = (*NEVER_ON_A_ROBOT[:-1], "zenoh", "agents")
    assert _loaded("from lfa.deploy import cli; cli.build([])", heavy) == "[]"
