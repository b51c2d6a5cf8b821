"""`lfa upgrade`: which machine is next, who is refused before anything changes, and a fleet of two versions (E35)."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from lfa.deploy.fleet.host.start_check import Found
from lfa.deploy.fleet.plan.fleet_file import load
from lfa.deploy.fleet.remote.hosts import StartedAs
from lfa.deploy.fleet.upgrade import as_started, differing, next_host, refusals
from lfa.deploy.process import identity
from lfa.deploy.process.identity import own_processes
from lfa.protocol.messages.header import WIRE_VERSION
from tests.rigs.lfa_runs import LFA
from tests.rigs.version_before import code_before, python_with

HOST_OF = {1: "a", 2: "b", 3: "c"}
RUNS = Found("0.2.0", 0, run="now", digest="d")


def test_the_leaders_machine_is_the_last_whoever_leads_meanwhile() -> None:
    left, done = ["a", "b", "c"], []
    for leader in (1, 3, 2):
        done.append(next_host(left, HOST_OF, (leader,)))
        left.remove(done[-1])
    assert done == ["b", "a", "c"]


def test_neighbouring_versions_that_run_this_fleet_are_not_refused() -> None:
    wires = {"a": WIRE_VERSION - 1, "b": WIRE_VERSION}
    assert refusals("convoy", {"a": RUNS, "b": RUNS}, wires, "d") == []


@pytest.mark.parametrize(
    ("found", "wire", "line"),
    [
        (RUNS, WIRE_VERSION + 1, f"must be {WIRE_VERSION} or older: upgrade from a machine with a newer lfa"),
        (RUNS, WIRE_VERSION - 2, f"must be {WIRE_VERSION - 1} or {WIRE_VERSION}: upgrade to an lfa of version"),
        (Found("0.2.0", 0), WIRE_VERSION, "does not run fleet convoy: must run, lfa up starts it"),
    ],
)
def test_what_cannot_be_upgraded_is_one_line_that_names_the_machine(found: Found, wire: int, line: str) -> None:
    (refused,) = refusals("convoy", {"a": RUNS, "b": found}, {"a": WIRE_VERSION, "b": wire}, "d")
    assert refused.startswith("host b: ")
    assert line in refused


def test_machines_that_run_two_other_files_are_refused() -> None:
    found = {name: Found("0.2.0", 0, run="now", digest=digest) for name, digest in (("a", "d"), ("b", "e"), ("c", "f"))}
    assert len(refusals("convoy", found, dict.fromkeys(found, WIRE_VERSION), "d")) == 2


def test_a_fleet_is_upgraded_as_it_was_started_also_with_options_that_its_file_lacks(tmp_path: Path) -> None:
    file = tmp_path / "fleet.toml"
    file.write_text('fleet = "convoy"\nscenario = "straight"\nhosts.a = { address = "localhost" }\n')
    started = StartedAs(secure=True, engine="systemd-system", boot=True)
    kept = as_started(load(file), started).file
    assert (kept.secure, kept.engine, kept.boot) == (True, "systemd-system", True)


def test_machines_that_were_started_otherwise_than_others_are_refused_in_one_line() -> None:
    assert differing({"a": StartedAs(secure=True), "b": StartedAs(secure=True)}) == []
    (line,) = differing({"a": StartedAs(secure=True), "b": StartedAs()})
    assert line.startswith("host b with secure = false, engine = own, boot = false, host a with secure = true")


# --- a real fleet: two machines of one computer, with an lfa of their own -------------------------------------------


class Convoy:
    """Fleet of two hosts on this computer, whose `lfa` is that of the commit before, each in a place of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.name = folder, f"upgrade-{os.getpid()}"
        self.file = folder / "fleet.toml"

    def write(self, pythons: dict[str, Path]) -> None:
        """Write the fleet file: the world at host `a` with robots 1 and 3, robot 2 at host `b`."""
        hosts = [
            f'hosts.{name} = {{ address = "{address}", router_port = {port}, python = "{pythons[name]}" }}'
            for name, address, port in (("a", "localhost", 7651), ("b", "127.0.0.1", 7652))
        ]
        on = 'robots.on = { 1 = "b", 2 = "a", 3 = "a" }'
        lines = [f'fleet = "{self.name}"', 'scenario = "straight"', "team = 3", *hosts, on]
        self.file.write_text("\n".join(lines) + "\n")

    def lfa(self, *arguments: str, python: Path | None = None) -> subprocess.CompletedProcess[str]:
        command = [*LFA, *arguments] if python is None else [str(python), *LFA[1:], *arguments]
        environment = {**os.environ, "HOME": str(self.folder)}
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, env=environment)


@pytest.fixture
def convoy() -> Iterator[Convoy]:
    made = Convoy(Path(tempfile.mkdtemp(prefix="lfa-", dir="/tmp")))
    try:
        yield made
    finally:
        made.lfa("down", str(made.file))
        for one in own_processes():
            if any(str(made.folder) in word for word in one.arguments):
                identity.send_signal(one, signal.SIGKILL)
        shutil.rmtree(made.folder, ignore_errors=True)


@pytest.mark.processes
def test_e35_a_running_fleet_is_upgraded_host_by_host_and_the_leaders_host_last(convoy: Convoy) -> None:
    code = code_before(convoy.folder / "code")
    pythons = {name: python_with(code, convoy.folder / name) for name in ("a", "b")}
    convoy.write(pythons)
    up = convoy.lfa("up", str(convoy.file), python=pythons["a"])
    assert up.returncode == 0, up.stderr
    done = convoy.lfa("upgrade", str(convoy.file))
    assert done.returncode == 0, done.stderr
    assert [line.split(":")[0] for line in done.stderr.splitlines() if "from version" in line] == ["host a", "host b"]
    again = convoy.lfa("upgrade", str(convoy.file), python=pythons["a"])
    assert "from version 6 of the messages to 6" in again.stderr
