"""What `lfa export` writes for containers, run as processes: the commands are right, and the keys open the doors."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from lfa.deploy.fleet.export.services import KEYS, SCENARIO, Service, secured, services
from lfa.deploy.fleet.plan.fleet_file import load
from lfa.deploy.fleet.remote.key_distribution import bundles
from lfa.deploy.fleet.security.private_files import ISSUED
from tests.rigs.lfa_runs import eventually, lfa
from tests.rigs.secured_fleet import free_port

pytestmark = pytest.mark.processes


def test_the_exported_commands_form_a_chain_with_the_exported_keys(tmp_path: Path) -> None:
    port = free_port()
    file = tmp_path / "convoy.toml"
    keys = f'keys = "{tmp_path / "authority"}"'
    where = f'hosts.a = {{ address = "localhost", router_port = {port} }}'
    file.write_text(f'fleet = "convoy"\nscenario = "straight"\nteam = 2\n{keys}\n{where}\n')
    plan = secured(load(file))
    fleet = services(plan, bundles(plan), "addresses")
    (tmp_path / "scenario.toml").write_text(fleet.scenario)
    running = [_start(one, tmp_path) for one in fleet.services]
    try:
        door = f"tls/127.0.0.1:{port}"
        issued = str(tmp_path / "authority" / ISSUED)
        eventually(lambda: _roles(door, issued) == ["leader", "follower"], "no chain is formed")
    finally:
        for process in running:
            process.kill()
            process.wait()


def _start(one: Service, folder: Path) -> subprocess.Popen[bytes]:
    """Start a service as its container would, with its keys and the scenario at places of this test."""
    own = folder / one.name
    own.mkdir()
    for name, text in one.keys.items():
        (own / name).write_text(text)
        (own / name).chmod(0o600)
    places = {KEYS: str(own), SCENARIO: str(folder / "scenario.toml")}
    program, *arguments = (places.get(word, word) for word in one.command)
    return subprocess.Popen([str(Path(sys.executable).parent / program), *arguments])


def _roles(door: str, keys: str) -> list[str]:
    told = lfa("watch", "--json", "--fleet", "convoy", "--connect", door, "--keys", keys)
    return [row["role"] for row in json.loads(told.stdout)["robots"]] if told.returncode == 0 else []
