"""Machines as they are: with addresses of IPv6, shells that greet, and modules of the user's own at home."""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path

import pytest

from tests.rigs.machines import Machines, machines, why_not

WHY_NOT = why_not()
pytestmark = [
    pytest.mark.hosts,
    pytest.mark.long,
    pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT)),
]
TOP, TAIL = 'scenario = "straight"\nteam = 2\nworld = "a"\n', '[robots]\nspread = ["a", "b"]'


def _comes_up(fleet: Machines, tail: str = "") -> None:
    file = str(fleet.write(TOP, tail=f"{TAIL}\n{tail}"))
    try:
        done = fleet.lfa("up", file, "--json")
        assert done.returncode == 0, done.stderr
        assert sorted(json.loads(done.stdout)["chain"]) == [1, 2]
        looked = fleet.lfa("doctor", file)
        assert looked.returncode == 0, looked.stdout
    finally:
        fleet.lfa("down", file)


def test_a_fleet_with_addresses_of_ipv6_comes_up() -> None:
    with machines(2, six=True) as fleet:
        refused = fleet.lfa("validate", str(fleet.write(TOP, tail=TAIL)))
        assert refused.returncode == 2, "Zenoh would make no certified link, and nothing would be heard for 60 s"
        assert "an address of IPv4" in refused.stderr
        _comes_up(fleet, '[links]\ntransport = "tcp"')


def test_a_shell_that_greets_in_a_home_of_shadowing_modules_does_no_harm() -> None:
    home = Path(tempfile.mkdtemp(prefix="lfa-", dir="/tmp"))
    try:
        for name in ("world.py", "random.py", "json.py"):
            (home / name).write_text("# a module of the user's own\n")
        greets = f"cd {home}; echo 'Hello from robot b, ROS_DOMAIN_ID=7'; exec sh -c \"$SSH_ORIGINAL_COMMAND\""
        with machines(2, shells={"b": greets}) as fleet:
            _comes_up(fleet)
    finally:
        shutil.rmtree(home, ignore_errors=True)
