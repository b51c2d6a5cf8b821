"""Who may import whom, as a table, and what a robot's process must never load."""

from __future__ import annotations

import ast
import importlib.util
import subprocess
import sys
from collections import Counter
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

ORDER = (
    "protocol/program_start", "protocol/errors", "protocol/output", "protocol/file_reading", "protocol/config_file",
    "protocol/plug_in", "protocol/clock",
    "protocol/incarnations",
    "protocol/names", "protocol/geometry", "protocol/mission", "protocol/mission_checks", "protocol/messages",
    "protocol/node", "protocol/topics", "protocol/outbox", "protocol/fleet_stop", "protocol/lease",
    "protocol/lease/machine", "protocol/witness", "protocol/transport", "protocol/runtime",

    "agents/config", "agents/formation", "agents/localization", "agents/perception", "agents/team_state",
    "agents/avoidance", "agents/recovery", "agents/exploration", "agents/following", "agents/controllers",
    "agents/leading", "agents/behaviors", "agents/navigator", "agents/stuck_policy", "agents/team_messages",
    "agents/load", "agents/telemetry", "agents/attendance", "agents/input_watch", "agents/chain_place", "agents/orders",
    "agents/command_publisher", "agents/subscriptions", "agents/robot_core", "agents/agent", "agents/cli",

    "world/description", "world/physics", "world/sensors", "world/robot_hardware", "world/added_obstacles",
    "world/time_grid", "world/saved_state", "world/simulated_sensors", "world/world", "world/checkpoint",
    "world/virtual_time", "world/collection", "world/routes", "world/simulator", "world/cli",

    "deploy/version", "deploy/whole_output", "deploy/terminal_text", "deploy/command_line", "deploy/robot_colours",
    "deploy/own_code", "deploy/recording",
    "deploy/process", "deploy/campaign", "deploy/client", "deploy/client/roster", "deploy/faults",
    "deploy/scenario_loading", "deploy/worlds", "deploy/analysis",
    "deploy/analysis/paper", "deploy/analysis/verification",
    "deploy/analysis/causes", "deploy/metrics", "deploy/operate", "deploy/ros", "deploy/ros/bridge",
    "deploy/view/picture", "deploy/view/figures", "deploy/view/report", "deploy/view/rerun", "deploy/view/terminal",
    "deploy/robot", "deploy/run", "deploy/lockstep", "deploy/learn", "deploy/simulate", "deploy/examples",
    "deploy/fuzz", "deploy/fuzz/fleet_stop", "deploy/fuzz/search", "deploy/fleet/plan", "deploy/config",
    "deploy/fleet/security", "deploy/fleet/engine", "deploy/fleet/host", "deploy/fleet/remote", "deploy/fleet/export",
    "deploy/fleet", "deploy/web", "deploy/bench/harness",
    "deploy/campaign/sweep", "deploy/campaign/merge", "deploy/campaign/engines", "deploy/campaign/commands",
    "deploy/bench/control_cases", "deploy/bench/driving", "deploy/bench/agents",
    "deploy/bench/operate", "deploy/bench/sim", "deploy/bench/web", "deploy/bench/learn",
    "deploy/bench/router", "deploy/bench/soak", "deploy/bench/lockstep", "deploy/bench", "deploy/bench/latency",
    "deploy/cli", "deploy/completion",
)  # fmt: skip
"""Rooms: a folder, or a file that lies directly in a package. Each imports only rooms that stand before it, so there is
no circle and nothing runs upwards."""

FILES_MAX = 14
LINES_MAX = 400

#           module       only imported by (within these packages)
ONLY: dict[str, tuple[set[str], tuple[str, ...]]] = {
    "zenoh":    ({"protocol/transport"}, PACKAGES),
    "time":     ({"protocol/clock"},     ("protocol", "agents")),
    "rerun":    (set(),                  ("protocol", "agents", "world")),
}  # fmt: skip

NEVER_ON_A_ROBOT = ("numpy", "pymunk", "rerun", "numba", "matplotlib", "mcap", "rich", "lfa.world", "lfa.deploy")
BASE = {"msgspec", "typer", "zenoh", "lfa"}


def _modules(path: Path) -> set[str]:
    """Full names of everything that the file imports, wherever in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def _imports(path: Path) -> set[str]:
    """Top-level names of everything that the file imports."""
    return {name.partition(".")[0] for name in _modules(path)}


def _files(*packages: str) -> list[Path]:
    return [path for package in packages for path in sorted((ROOT / package).rglob("*.py"))]


def room(path: Path) -> str | None:
    """The room of a file by its path below the root; None for the `__init__.py` of a package itself."""
    if len(path.parts) > 2:
        return str(path.parent)
    return None if path.name == "__init__.py" else str(path.with_suffix(""))


def _room_of_module(name: str, root: Path = ROOT) -> str | None:
    """The room of an imported name `lfa.a.b.c`, where c may be a module, a folder or a thing in one."""
    parts = name.split(".")[1:]
    for n in range(len(parts), 0, -1):
        file = Path(*parts[:n]).with_suffix(".py")
        if (root / file).is_file():
            return room(file)
        if (root / Path(*parts[:n])).is_dir():
            return room(Path(*parts[:n]) / "__init__.py")
    raise AssertionError(f"{name} is imported and does not exist")


def _not_before(order: tuple[str, ...], root: Path = ROOT) -> list[str]:
    """Imports that run upwards or inside a circle, a line each."""
    place = {name: n for n, name in enumerate(order)}
    found = []
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            own = room(path.relative_to(root))
            for name in sorted(_modules(path)):
                other = _room_of_module(name, root) if name.startswith("lfa.") else None
                if own and other and own != other and place[other] > place[own]:
                    found.append(f"{path.relative_to(root)} ({own}) imports {name} ({other})")
    return found


def test_every_room_is_in_the_table() -> None:
    rooms = {room(path.relative_to(ROOT)) for path in _files(*PACKAGES) if _code(path)} - {None}
    assert rooms == set(ORDER), f"not in ORDER: {rooms - set(ORDER)}; gone: {set(ORDER) - rooms}"


def _code(path: Path) -> bool:
    return path.name != "__init__.py"


def test_no_import_runs_upwards_between_rooms() -> None:
    found = _not_before(ORDER)
    table = "\n".join(f"{n:3} {name}" for n, name in enumerate(ORDER))
    print(f"{table}\n{len(found)} imports run upwards")
    assert not found, "\n".join(found)


def test_a_planted_import_upwards_is_seen(tmp_path: Path) -> None:
    for package in PACKAGES:
        (tmp_path / package).mkdir()
    (tmp_path / "protocol" / "lease").mkdir()
    (tmp_path / "protocol" / "lease" / "lease.py").write_text("from lfa.agents.agent import Agent\n")
    (tmp_path / "agents" / "agent.py").write_text("class Agent: ...\n")
    (found,) = _not_before(("protocol/lease", "agents/agent"), tmp_path)
    assert "protocol/lease/lease.py" in found


def test_a_folder_holds_no_more_files_than_a_reader_keeps_in_mind() -> None:
    count = Counter(path.parent.relative_to(ROOT) for path in _files(*PACKAGES) if _code(path))
    assert {str(folder): n for folder, n in count.items() if n > FILES_MAX} == {}


def test_no_file_is_longer_than_a_reader_takes_in_at_once() -> None:
    lines = {str(path.relative_to(ROOT)): len(path.read_text().splitlines()) for path in _files(*PACKAGES)}
    assert {name: n for name, n in lines.items() if n > LINES_MAX} == {}


@pytest.mark.parametrize("name", PACKAGES)
def test_no_package_is_importable_by_its_flat_name(name: str) -> None:
    """`openai-agents` installs `agents`, and a user's own `world.py` must not break a robot."""
    code = f"import lfa.{name}, importlib.util as u; print(u.find_spec({name!r}))"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, timeout=30, check=True)
    assert done.stdout.strip() == "None"
    assert importlib.util.find_spec(name) is None, "pytest has the checkout on its path"


def test_no_file_imports_a_flat_name() -> None:
    flat = {str(path.relative_to(ROOT)) for path in _files(*PACKAGES, "tests") if _imports(path) & set(PACKAGES)}
    assert not flat, f"{flat} import by a flat name: it is lfa.agents, lfa.world, ..."


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_go_one_way(package: str) -> None:
    for path in _files(package):
        own = {name.split(".")[1] for name in _modules(path) if name.startswith("lfa.")}
        foreign = own - MAY[package]
        assert not foreign, f"{path.relative_to(ROOT)} imports {foreign}; {package} may import {MAY[package]}"


@pytest.mark.parametrize("module", ONLY)
def test_a_module_with_one_door_has_one_door(module: str) -> None:
    allowed, packages = ONLY[module]
    users = {room(path.relative_to(ROOT)) for path in _files(*packages) if module in _imports(path)}
    assert users <= allowed, f"{module} is imported by {users - allowed}"


@pytest.mark.parametrize("package", ["protocol", "agents"])
def test_protocol_and_agents_need_no_more_than_the_base(package: str) -> None:
    for path in _files(package):
        third = {name for name in _imports(path) if name not in sys.stdlib_module_names}
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
    heavy = (*NEVER_ON_A_ROBOT[:-1], "zenoh", "lfa.agents")
    assert _loaded("from lfa.deploy import cli; cli.build([])", heavy) == "[]"
