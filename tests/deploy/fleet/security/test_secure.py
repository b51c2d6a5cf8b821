"""`lfa up --secure` for two machines that are this one: everybody has a certificate, and a stolen one is revoked."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lfa.deploy.fleet.security import authority
from lfa.deploy.process import identity
from lfa.deploy.process.identity import own_processes
from lfa.protocol import clock
from lfa.protocol.messages.codec import encode
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.stop import StopOrder, StopWord
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.credentials import credentials
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import answers
from tests.rigs.lfa_runs import LFA, eventually
from tests.rigs.secured_fleet import free_port

pytestmark = pytest.mark.processes

FLEET = f"secure-{os.getpid()}"


class Home:
    """An operator's home, with the fleet's file and keys."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "fleet.toml"
        ports = {free_port() for _ in range(8)}
        hosts = [f'hosts.{name} = {{ address = "127.0.0.1", router_port = {ports.pop()} }}' for name in "ab"]
        self.file.write_text("\n".join([f'fleet = "{FLEET}"', 'scenario = "straight"', "team = 2", *hosts]))
        self.keys = folder / ".local/state/lfa" / f"{FLEET}.keys"

    def lfa(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, "HOME": str(self.folder)}
        return subprocess.run(
            [*LFA, *arguments], capture_output=True, text=True, timeout=90, env=environment, check=False
        )

    def state(self, host: str) -> Path:
        return self.folder / ".local/state/lfa" / FLEET / host

    def socket(self, host: str) -> str:
        return f"unixsock-stream/{self.state(host) / 'router.sock'}"

    def lets_in(self, name: str, host: str, folder: Path) -> bool:
        return answers(self.socket(host), credentials(folder, name, clock.wall_ms()))

    def chain(self) -> list[int]:
        """Return the chain of the fleet, which runs: nothing is started."""
        chain: list[int] = json.loads(self.lfa("up", str(self.file), "--secure", "--json").stdout)["chain"]
        return chain

    def wrong(self) -> dict[str, str]:
        found: list[dict[str, Any]] = json.loads(self.lfa("doctor", str(self.file), "--json").stdout)["findings"]
        return {f"{one['host']} {one['check']}": one["says"] for one in found if not one["ok"]}


@pytest.fixture(scope="module")
def home() -> Iterator[Home]:
    made = Home(Path(tempfile.mkdtemp(prefix="lfa-", dir="/tmp")))
    try:
        done = made.lfa("up", str(made.file), "--secure", "--json")
        assert done.returncode == 0, done.stderr
        assert sorted(json.loads(done.stdout)["chain"]) == [1, 2]
        yield made
    finally:
        made.lfa("down", str(made.file))
        for one in own_processes():
            if any(str(made.folder) in word for word in one.arguments):
                identity.send_signal(one, signal.SIGKILL)
        shutil.rmtree(made.folder, ignore_errors=True)


def test_who_shows_nothing_is_let_in_by_no_router(home: Home) -> None:
    socket = f"unixsock-stream/{home.state('a') / 'router.sock'}"
    assert not answers(socket)
    assert home.lets_in("operator", "a", home.state("a") / "keys")


def test_a_machine_holds_the_keys_of_its_own(home: Home) -> None:
    held = {host: {path.stem for path in (home.state(host) / "keys").glob("robot*.key")} for host in "ab"}
    assert held == {"a": {"robot1"}, "b": {"robot2"}}
    assert not [path for host in "ab" for path in home.state(host).rglob("*") if path.name == "ca.key"]


def test_the_operators_commands_show_the_operators_certificate(home: Home) -> None:
    told = json.loads(home.lfa("ps", str(home.file), "--json").stdout)
    assert {row["process"] for row in told["processes"]} == {"router", "world", "robot1", "robot2"}
    heard = json.loads(home.lfa("topic", "list", "pose", "--fleet", FLEET, "--seconds", "1", "--json").stdout)
    assert {rate["channel"] for rate in heard} == {"robot1/pose", "robot2/pose"}


def test_e29_only_the_operators_certificate_stops_a_secured_fleet(home: Home) -> None:
    bus = ZenohBus(
        home.socket("b"), Inbox(), credentials=credentials(home.state("b") / "keys", "robot2", clock.wall_ms())
    )
    forged = StopOrder(Header("operator", 1, 1, 0.0), StopWord(9, True))
    for _ in range(5):
        bus.publish(f"lfa/{FLEET}/operator/stop", encode(forged))
        clock.sleep(0.05)
    bus.close()
    refused = home.lfa("resume", "--fleet", FLEET)
    assert (refused.returncode, refused.stdout) == (2, ""), "the forged stop stopped somebody"
    assert refused.stderr == "lfa: resume: none of the 2 robots that answer is stopped\n"
    for word in ("stop", "resume"):
        done = home.lfa(word, "--fleet", FLEET, "--json")
        assert done.returncode == 0, done.stdout + done.stderr
        assert json.loads(done.stdout)["done"] == [1, 2]


def test_e35_a_secured_fleet_is_upgraded_host_by_host_and_stays_secured(home: Home) -> None:
    last = {1: "a", 2: "b"}[home.chain()[0]]
    done = home.lfa("upgrade", str(home.file), "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["upgraded"] == sorted("ab", key=lambda name: name == last)
    assert sorted(home.chain()) == [1, 2]
    for host in "ab":
        assert not answers(home.socket(host)), "who shows no certificate is let in after the upgrade"
        assert home.lets_in({"a": "robot1", "b": "robot2"}[host], host, home.state(host) / "keys")


def test_a_revoked_robot_is_let_in_by_no_router_and_the_rest_goes_on(home: Home) -> None:
    stolen = home.folder / "stolen"
    shutil.copytree(home.keys / "issued", stolen)
    assert home.lets_in("robot2", "b", stolen)
    done = home.lfa("keys", "revoke", str(home.file), "robot2", "--json")
    assert done.returncode == 0 and json.loads(done.stdout)["pushed"], done.stderr
    assert not home.lets_in("robot2", "b", stolen) and not home.lets_in("robot2", "a", stolen)

    def rest() -> bool:
        heard = json.loads(home.lfa("topic", "list", "pose", "--fleet", FLEET, "--seconds", "1", "--json").stdout)
        return {rate["channel"] for rate in heard} == {"robot1/pose"}

    eventually(rest, "robot 1 alone should be heard")


def test_a_stolen_copy_of_a_lost_machines_keys_orders_nothing_once_the_machine_is_revoked(home: Home) -> None:
    """The operator's key that lay there would otherwise restart robot 1."""
    stolen = home.folder / "disk of b"
    shutil.copytree(home.state("b") / "keys", stolen)
    assert home.lets_in("operator", "a", stolen)
    done = home.lfa("keys", "revoke", str(home.file), "--machine", "b", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["hosts"] == ["a"], "a lost machine is sent nothing"
    for name in ("operator", "recorder", "host-b"):
        assert not home.lets_in(name, "a", stolen), name
    assert home.lets_in("operator", "a", home.keys / "issued"), "the person's own key is as good as before"
    assert home.lets_in("operator", "a", home.state("a") / "keys"), "and so is that of machine a"


def test_doctor_names_an_expired_certificate(home: Home) -> None:
    assert "a certificate" not in home.wrong()
    ca = authority.load(home.keys / "ca.pem", home.keys / "ca.key")
    authority.issue(home.state("a") / "keys" / "robot1", ca, "robot1", (), -0.01)
    assert "robot1.pem: expired on" in home.wrong()["a certificate"]
