"""`lfa upgrade` over ssh: four machines, each with an lfa of its own, of the version of the messages before (E35)."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

from lfa.deploy.bench.harness.team import endless
from lfa.protocol.messages.header import WIRE_VERSION
from lfa.protocol.transport.zenoh_config import answers
from tests.rigs.host_observer import onlooker
from tests.rigs.live_team import check_terms_in
from tests.rigs.machines import Machines, machines, why_not
from tests.rigs.version_before import ROOT, code_before, python_with

WHY_NOT = why_not()
pytestmark = [pytest.mark.hosts, pytest.mark.long, pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))]

ROBOTS = (1, 2, 3, 4)
TOP = 'scenario = "endless.toml"'
COURSE = f"""
title = "A long way round, in keys that both versions know"
time_limit_s = 1e6
[mission]
robots = {list(ROBOTS)}
control_hz = 20.0
[mission.leading]
route_m = {[list(point) for point in endless(len(ROBOTS)).mission.leading.route_m]}
cruise_mps = 0.1
[mission.formation]
separation_m = 3.0
"""
WAIT_S = "150"
PATIENCE_S = 600.0
OTHER_WIRE = "import lfa.protocol.messages.header as header; header.WIRE_VERSION {change}"


class OldFleet:
    """Fleet of four machines with a robot each that was started by the version before; the operator has today's."""

    def __init__(self, made: Machines, *, secured: bool) -> None:
        self.machines, self.secured = made, secured
        code = code_before(made.folder / "code")
        self.pythons = {name: python_with(code, made.folder / f"venv-{name}") for name in made.names}
        (made.folder / "endless.toml").write_text(COURSE)

    def write(self, name: str = "", python: str = "") -> str:
        """Write the fleet file, with another Python for one machine; return its path."""
        pythons = {one: {"python": str(path)} for one, path in self.pythons.items()}
        if name:
            pythons[name] = {"python": python}
        return str(self.machines.write(TOP, pythons))

    def up(self) -> None:
        words = ["up", self.write(), "--wait", WAIT_S, *(["--secure"] if self.secured else [])]
        done = self.machines.lfa(*words, python=self.pythons["a"], timeout_s=PATIENCE_S)
        assert done.returncode == 0, done.stderr

    def pids(self, name: str) -> set[int]:
        return {one.pid for one in self.machines.processes(name)}


@pytest.fixture(scope="module", params=[True, pytest.param(False, marks=pytest.mark.long)], ids=["secured", "plain"])
def fleet(request: pytest.FixtureRequest) -> Iterator[OldFleet]:
    with machines(4) as made:
        old = OldFleet(made, secured=request.param)
        old.up()
        yield old
        made.lfa("down", old.write())


def test_e35_machines_are_upgraded_over_ssh_the_leaders_last_and_never_do_two_lead(fleet: OldFleet) -> None:
    made = fleet.machines
    before = {name: fleet.pids(name) for name in made.names}
    with onlooker(made, "abcd", ROBOTS) as look:
        look.wait(lambda: look.whole(set(ROBOTS)), "not whole", PATIENCE_S)
        upgrade = made.lfa_begins("upgrade", fleet.write(), "--wait", WAIT_S, "--json")
        try:
            look.wait(lambda: upgrade.poll() is not None, "it does not end", PATIENCE_S)
        finally:
            upgrade.kill()
            out, err = upgrade.communicate()
        assert upgrade.returncode == 0, err
        look.wait(lambda: look.whole(set(ROBOTS)), "not whole again", PATIENCE_S)
        check_terms_in(look.events)
    steps = [line for line in err.splitlines() if "from version" in line]
    assert {line[8:].partition(";")[0] for line in steps} == {f"from version 5 of the messages to {WIRE_VERSION}"}
    leader = int(steps[-1].rpartition("robot")[2].split()[0])
    assert json.loads(out)["upgraded"] == [line[5] for line in steps]
    assert leader in made.part(steps[-1][5]).robots, "the leader's machine is not the last"
    assert [name for name in made.names if before[name] & fleet.pids(name)] == [], "something old runs on"


def test_e35_an_upgrade_leaves_a_secured_fleet_secured_and_a_plain_one_plain(fleet: OldFleet) -> None:
    made = fleet.machines
    assert [made.part(name).secure for name in made.names] == [fleet.secured] * 4
    assert [answers(made.part(name).socket) for name in made.names] == [not fleet.secured] * 4


@pytest.mark.parametrize(("change", "right"), [("-= 2", "lfa of version"), ("+= 1", "from a machine with a newer lfa")])
def test_e35_a_machine_of_no_neighbouring_version_is_refused_in_one_line_and_nothing_changes(
    fleet: OldFleet, change: str, right: str
) -> None:
    made = fleet.machines
    before = {name: fleet.pids(name) for name in made.names}
    other = python_with(ROOT / ".namespace", made.folder / f"other{change[0]}")
    site = next((other.parents[1] / "lib").glob("python*/site-packages"))
    (site / "sitecustomize.py").write_text(OTHER_WIRE.format(change=change))
    done = made.lfa("upgrade", fleet.write("c", str(other)), "--wait", WAIT_S, timeout_s=PATIENCE_S)
    (line,) = done.stderr.splitlines()
    assert (done.returncode, line.split(":")[1]) == (2, " host c")
    assert right in line
    assert {name: fleet.pids(name) for name in made.names} == before
