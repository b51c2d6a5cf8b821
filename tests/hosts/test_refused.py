"""What is wrong with a machine is one line about that machine, and nothing is started on any other."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from lfa.deploy.fleet.host.end import ANSWER
from lfa.deploy.fleet.host.ledger import living
from lfa.deploy.process.identity import send_signal
from tests.rigs.machines import Machines, machines, why_not
from tests.rigs.network_namespaces import PORT

WHY_NOT = why_not()
pytestmark = [pytest.mark.hosts, pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))]

NOBODY = "10.77.0.99"
OLD_PYTHON = f'#!/bin/sh\necho \'{ANSWER}{{"python": [3, 9, 2], "lfa": "", "wall_ms": 0}}\'\nexit 0\n'
AN_HOUR_AHEAD = """
import time
ns, s = time.time_ns, time.time
time.time_ns, time.time = lambda: ns() + 3600 * 10**9, lambda: s() + 3600.0
"""
TOP = 'scenario = "straight"\nteam = 2\n'
UNWATCHED = TOP + "restart.watchdog_s = 3600.0\n"
"""A fleet whose supervisors wait for a process that hangs: on a busy machine a command takes longer than 5 s."""


@pytest.fixture(scope="module")
def six() -> Iterator[Machines]:
    with machines(6) as made:
        yield made


@pytest.fixture
def clean(six: Machines) -> Iterator[Machines]:
    """Whatever the test has left would run on."""
    yield six
    assert [living(six.state(name)) for name in six.names] == [None] * len(six.names)
    assert [one for name in six.names for one in six.processes(name)] == []


def _lines(done: subprocess.CompletedProcess[str]) -> dict[str, str]:
    """What is said about each host."""
    said = [line.removeprefix("lfa: ") for line in done.stderr.splitlines() if line.startswith("lfa: host ")]
    return {line.split()[1].rstrip(":"): line for line in said}


def test_machines_that_cannot_be_reached_or_have_no_python_are_named_a_line_each(clean: Machines) -> None:
    fleet = clean
    (fleet.folder / "nobody").write_text("")
    fleet.serve("c", authorized="nobody")
    known = fleet.home / ".ssh/known_hosts"
    everybody = known.read_text()
    known.write_text("".join(line for line in everybody.splitlines(True) if not line.startswith(fleet.address("d"))))
    old = fleet.folder / "python3.9"
    old.write_text(OLD_PYTHON)
    old.chmod(0o755)
    wrong = {"b": {"address": NOBODY}, "e": {"python": "/nonexistent/python"}, "f": {"python": str(old)}}
    done = fleet.lfa("up", str(fleet.write(TOP, wrong)))
    looked = fleet.lfa("doctor", "--json", str(fleet.fleet_file))
    known.write_text(everybody)
    fleet.serve("c")
    lines = _lines(done)
    assert done.returncode == 2
    assert set(lines) == set("bcdef"), done.stderr
    assert f"cannot be reached by ssh at {NOBODY}" in lines["b"]
    assert "refuses your key: must let you in by key (ssh-copy-id root@" in lines["c"]
    assert f"ssh knows no key of {fleet.address('d')}" in lines["d"]
    assert "python = /nonexistent/python: does not run there" in lines["e"]
    assert "is 3.9.2 there: must be 3.11 or newer" in lines["f"]
    wrongs = {(one["host"], one["check"]) for one in json.loads(looked.stdout)["findings"] if not one["ok"]}
    assert wrongs == {("b", "ssh"), ("c", "ssh"), ("d", "ssh"), ("e", "python"), ("f", "python")}


def test_machines_that_would_not_do_are_named_a_line_each(clean: Machines) -> None:
    """Another lfa, a clock an hour ahead, a port in use, no room: and doctor finds the same, and a closed port."""
    fleet = clean
    fleet.state("e").mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m,mode=0700", "none", str(fleet.state("e"))], check=True)
    bind = f"s = socket.socket(type=socket.SOCK_DGRAM); s.bind(('', {PORT}))"
    listen = f"import socket, time; {bind}; print(flush=True); time.sleep(120)"
    taken = [*fleet.net.enter(fleet.host("d")), sys.executable, "-c", listen]
    with subprocess.Popen(taken, stdout=subprocess.PIPE) as holder:
        try:
            assert holder.stdout is not None and holder.stdout.readline()
            fleet.serve("e")
            fleet.net.close_port(fleet.host("f"), PORT)
            wrong = {
                "b": {"python": fleet.python("b", version="0.0.9")},
                "c": {"python": fleet.python("c", startup=AN_HOUR_AHEAD)},
            }
            done = fleet.lfa("up", str(fleet.write(TOP, wrong)))
            looked = fleet.lfa("doctor", "--json", str(fleet.fleet_file))
        finally:
            holder.kill()
            fleet.net.heal()
            subprocess.run(["umount", "-l", str(fleet.state("e"))], check=True)
            fleet.serve("e")  # it has seen the mount, and keeps it
    lines = _lines(done)
    assert done.returncode == 2
    assert set(lines) == set("bcde"), done.stderr
    assert "has lfa 0.0.9: must be" in lines["b"]
    assert "its wall clock is 3600 s ahead: must be within 60 s" in lines["c"]
    assert f"router_port = {PORT}: Address already in use: must be a free port" in lines["d"]
    assert "MiB are free there: must be at least" in lines["e"]
    wrongs = {(one["host"], one["check"]) for one in json.loads(looked.stdout)["findings"] if not one["ok"]}
    assert wrongs == {("b", "lfa"), ("c", "clock"), ("d", "place"), ("e", "place"), ("f", "port")}


@pytest.mark.long
def test_of_two_robots_of_one_name_on_two_machines_one_is_refused_and_named(clean: Machines) -> None:
    """Whichever comes second. When it is the fleet's, all that has been started is taken down again."""
    fleet = clean
    file = fleet.write(TOP + 'links.transport = "tcp"\n', tail='[robots]\non = { 1 = "a" }')
    connect = ("--connect", f"tcp/{fleet.address('a')}:{PORT}")
    agent = ("lfa.agents.cli", "--role", "leader", "--id", "1", "--fleet", "convoy", *connect)
    command = [*fleet.net.enter(fleet.host("b")), sys.executable, "-m", *agent]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as stranger:
        try:
            done = fleet.lfa("up", str(file), "--wait", "30")
            if done.returncode == 0:
                assert stranger.wait(20.0) == 2
        finally:
            stranger.kill()
            fleet.lfa("down", str(file))
        told = stranger.stderr.read() if stranger.stderr is not None else ""
    if done.returncode == 0:
        assert "robot1 already runs in fleet 'convoy'" in told
        return
    assert done.returncode == 1
    assert "robot1 already runs in fleet 'convoy'" in done.stderr or "speaks in its name" in done.stderr
    assert "taken down again: a, b, c, d, e, f" in done.stderr


@pytest.mark.long
def test_doctor_names_a_router_that_is_missing(six: Machines) -> None:
    fleet = six
    assert fleet.lfa("up", str(fleet.write(UNWATCHED))).returncode == 0
    try:
        router = next(one for one in fleet.processes("b") if "lfa.deploy.fleet.host.router" in one.arguments)
        assert send_signal(router, signal.SIGSTOP)
        looked = fleet.lfa("doctor", "--json", str(fleet.fleet_file))
    finally:
        fleet.lfa("down", str(fleet.fleet_file))
    wrongs = {(one["host"], one["check"]) for one in json.loads(looked.stdout)["findings"] if not one["ok"]}
    assert wrongs == {("b", "router"), ("b", "port")}
