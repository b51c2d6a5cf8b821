"""The fleet file: what it means, and that everything wrong with it is said at once."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from lfa.deploy.config import schema
from lfa.deploy.fleet.plan.fleet_file import FleetFile, is_fleet_file, load
from lfa.protocol.config_file.mistake import RefusedFile
from lfa.protocol.errors import Refused

EXAMPLE = Path("deploy/fleet.example.toml")
TWO = """
hosts.a.address = "10.0.0.1"
hosts.b = { address = "10.0.0.2", labels = ["arm", "small"] }
"""


def _file(folder: Path, text: str) -> Path:
    path = folder / "convoy.toml"
    path.write_text(text)
    return path


def test_the_shipped_example_is_one_machine_with_everything_on_it() -> None:
    plan = load(EXAMPLE)
    assert list(plan.hosts) == [plan.file.world] == [plan.file.witness]
    assert plan.robots_on(plan.file.world) == plan.scenario.mission.robots


def test_a_fleet_is_called_as_its_file_and_robots_are_dealt_out_in_turn(tmp_path: Path) -> None:
    plan = load(_file(tmp_path, "team = 5\n" + TWO))
    assert plan.name == "convoy"
    assert (plan.robots_on("a"), plan.robots_on("b")) == ((1, 3, 5), (2, 4))


def test_a_robot_with_a_place_has_it_and_labels_name_machines(tmp_path: Path) -> None:
    plan = load(_file(tmp_path, f"team = 4\n{TWO}\n[robots]\nspread = ['arm']\non = {{ 2 = 'a' }}"))
    assert (plan.robots_on("a"), plan.robots_on("b")) == ((2,), (1, 3, 4))


WRONG = {
    "sed = 3": "sed = 3: no such key: did you mean 'seed'?",
    "seed = 'x'": "seed = x: must be a whole number, not text",
    "scenario = 'papr_path1'": "did you mean 'paper_path1'?",
    "world = 'c'": "world = c: must be one of the hosts: a, b",
    "witness = 'd'": "witness = d: must be one of the hosts: a, b",
    "fleet = 'My Fleet'": "fleet = My Fleet: must be small letters",
    "profile = 'slow'": "profile = slow: must be one of fast, std, wifi, auto",
    "set = ['world.beams=1']": "beams = 1",
    "robots.on = { 9 = 'a' }": "robots.on.9 = a: no such robot",
    "robots.on = { 1 = 'c' }": "robots.on.1 = c: must be one of the hosts: a, b",
    "robots.spread = ['x86']": "robots.spread[0] = x86: must be one of the hosts: a, b, or a label",
    "restart.policy = 'sometimes'": "restart.policy = sometimes: must be one of never, on-failure, always",
    "restart.window_s = 0.0": "restart.window_s = 0.0: must be a number from 1 to 86400",
    "robots.on = { 01 = 'b' }": "robots.on.01 = b: no such robot",
    "links.pairs = [['a', 'a']]": "links.pairs[0] = [a, a]: must be two machines",
    "team = 'x'": "team = x: must be a whole number, not text",
    "links.pairs = [['a', 'c']]": "links.pairs[0] = [a, c]: c must be one of the hosts",
    "hosts.c.address = 'localhost'": "hosts.c.address = localhost: must be an address that the other machines reach",
    "hosts.c.address = '10.0.0.1'": "router_port = 7447: must not be c's",
    "hosts.c.adress = 'x'": "hosts.c.adress = x: no such key: did you mean 'address'?",
    "hosts.C_.address = 'c'": "hosts.C_: must be called by small letters",
    "hosts.c = { address = 'c', port = 99999 }": "hosts.c.port = 99999: must be a port",
    "hosts.c = { address = 'c', python = 'p', venv = 'v' }": "hosts.c.venv = v: must not be given beside python",
    "hosts.c = { address = 'c', state = 'x' }": "hosts.c.state = x: must begin with / or ~/",
}


@pytest.mark.parametrize("line", WRONG)
def test_a_mistake_is_a_line_with_file_key_value_and_what_would_be_right(tmp_path: Path, line: str) -> None:
    path = _file(tmp_path, f"{line}\n{TWO}")
    with pytest.raises(RefusedFile) as refused:
        load(path)
    said = [told for told in refused.value.lines if WRONG[line] in told]
    assert said and re.match(rf"{re.escape(str(path))}:[13]: ", said[0])


def test_all_mistakes_are_said_at_once(tmp_path: Path) -> None:
    lines = [line for line in WRONG if not line.startswith(("hosts.c", "robots.", "set", "links"))]
    with pytest.raises(RefusedFile) as refused:
        load(_file(tmp_path, "\n".join([lines[0], *lines[2:], TWO])))
    assert len(refused.value.lines) == len(lines) - 1


@pytest.mark.parametrize("text", ["hosts = {}", "", "hosts = 3", "\x00", "[hosts", f"x = {'[' * 5000}"])
def test_what_is_no_fleet_file_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(Refused):
        load(_file(tmp_path, text))


def test_what_never_ends_is_no_fleet_file() -> None:
    assert not is_fleet_file(Path("/dev/zero"))
    with pytest.raises(Refused, match=r"^/dev/zero: longer than"):
        load(Path("/dev/zero"))


def test_every_key_of_the_example_is_documented() -> None:
    documented = {key.path for key in schema.documented(FleetFile)}
    given = tomllib.loads(EXAMPLE.read_text())
    assert {"fleet", "scenario", "seed"} <= given.keys()
    assert {f"restart.{key}" for key in given["restart"]} <= documented
    assert {f"hosts.NAME.{key}" for key in given["hosts"]["laptop"]} <= documented
