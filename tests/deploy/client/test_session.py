"""Which fleet a command means: one that it names by fleet or router, whatever else runs on the machine."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
from pathlib import Path
from typing import cast

import pytest

from lfa.deploy.client import session
from lfa.deploy.client.discovery import Running
from lfa.deploy.client.session import FleetAddress, Subscriber, find, scenario_of_fleet
from lfa.deploy.fleet.host.router import default_endpoints
from lfa.deploy.process.identity import Identity
from lfa.protocol.errors import Refused
from lfa.protocol.node import PeerUp
from lfa.protocol.transport.bus import Inbox, Wake
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import default_endpoint
from lfa.world.description.load import SCENARIOS

MINE, OTHER, THIRD = "unixsock-stream//tmp/mine", "tcp/127.0.0.1:7999", "tcp/far:7450"
OWN, NEXT = "unixsock-stream//tmp/worlds", "tls/10.0.0.2:7447"
"""Routers of a host that has the world alone: its own and the next one."""
KEYS = Path("/var/keys")
USUAL = "the machine's usual endpoint"
"""Its folder is another one in each process of the tests."""


@pytest.fixture
def two_fleets(monkeypatch: pytest.MonkeyPatch) -> None:
    running = [
        Running(robot, fleet, endpoint, Identity(robot, 1, 0, ()), keys)
        for robot, fleet, endpoint, keys in (
            (1, "mine", MINE, None),
            (2, "mine", MINE, None),
            (1, "other", OTHER, None),
            (0, "worlds", f"{OWN},{NEXT}", KEYS),
        )
    ]
    monkeypatch.setattr(session, "members", lambda: running)


@pytest.mark.usefixtures("two_fleets")
@pytest.mark.parametrize(
    ("fleet", "connect", "name", "endpoint", "robots"),
    [
        ("mine", None, "mine", MINE, 2),
        (None, MINE, "mine", MINE, 2),
        (None, OTHER, "other", OTHER, 1),
        ("other", OTHER, "other", OTHER, 1),
        ("worlds", None, "worlds", f"{OWN},{NEXT}", 0),
        (None, OWN, "worlds", OWN, 0),
        ("far", THIRD, "far", THIRD, 0),
        ("far", None, "far", USUAL, 0),
    ],
)
def test_another_fleet_does_not_stop_a_command_that_names_its_own(
    fleet: str | None, connect: str | None, name: str, endpoint: str, robots: int
) -> None:
    found = find(fleet, connect)
    at = default_endpoint() if endpoint == USUAL else endpoint
    assert (found.name, found.endpoint, len(found.team)) == (name, at, robots)


@pytest.mark.usefixtures("two_fleets")
@pytest.mark.parametrize("connect", [None, OWN, NEXT])
def test_a_command_shows_the_certificate_of_its_host_at_each_of_the_hosts_routers(connect: str | None) -> None:
    assert find("worlds", connect).keys == KEYS


def test_a_fleet_of_which_nothing_is_heard_is_not_there_and_one_without_a_leader_is() -> None:
    wake = Wake()
    subscriber = Subscriber(FleetAddress("far", THIRD, ()), cast(ZenohBus, None), Inbox(wake, 1), wake)
    with pytest.raises(Refused, match="pause: nothing of fleet far is heard at tcp"):
        subscriber.refuse_absent("pause", 0.1)
    subscriber._see_token(PeerUp("robot2", 1))
    subscriber.refuse_absent("pause")


@pytest.mark.usefixtures("two_fleets")
@pytest.mark.parametrize(
    ("connect", "says"), [(None, "several fleets run here"), (THIRD, "no agent of yours is at the router tcp/far")]
)
def test_a_command_that_names_no_fleet_says_what_to_name(connect: str | None, says: str) -> None:
    with pytest.raises(Refused, match=says):
        find(None, connect)


def test_the_router_of_another_user_does_not_stop_ones_own(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as theirs:
        theirs.bind(("127.0.0.1", 0))
        theirs.listen()
        shared = f"tcp/127.0.0.1:{theirs.getsockname()[1]}"
        assert default_endpoints(shared) == [default_endpoint()]
        assert f"{shared} is taken" in capsys.readouterr().err
    assert default_endpoints(shared) == [default_endpoint(), shared]


def test_the_walls_of_a_fleet_are_known_wherever_a_command_is_said(tmp_path: Path) -> None:
    """Its world names its scenario from the folder in which it was started; the command runs in another one."""
    shutil.copy(SCENARIOS / "paper_path1.toml", tmp_path / "mine.toml")
    waits = [sys.executable, "-c", "input()", "lfa-world", "mine.toml", "--fleet", tmp_path.name]
    with subprocess.Popen(waits, cwd=tmp_path, stdin=subprocess.PIPE, text=True) as world:
        try:
            scenario = scenario_of_fleet(FleetAddress(tmp_path.name, MINE, ()))
        finally:
            world.communicate("\n")
    assert scenario is not None and scenario.world.walls_m
