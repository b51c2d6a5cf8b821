"""Operators' commands by hand on a fleet of four machines, secured and plain, from its machines and from afar."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from collections.abc import Iterator

import pytest
from msgspec.structs import replace

from lfa.deploy.bench.harness.team import endless
from lfa.deploy.process import identity
from lfa.deploy.recording.recorder import EVENTS
from lfa.deploy.recording.run_folder import toml
from lfa.world.description.scenario import SpareRobot
from tests.rigs.host_observer import onlooker
from tests.rigs.lfa_runs import eventually
from tests.rigs.live_team import check_terms_in
from tests.rigs.machines import Machines, machines, why_not
from tests.rigs.network_namespaces import PORT
from tests.rigs.version_before import ROOT, python_with

WHY_NOT = why_not()
pytestmark = [pytest.mark.hosts, pytest.mark.long, pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))]

ROBOTS, SPARE = (1, 2, 3, 4, 5, 6), 9
WORLD = "a"
WAIT_S, PATIENCE_S = "150", 600.0


class Operated:
    """The fleet, with a world on one machine, two robots on each of three, and a spare."""

    def __init__(self, made: Machines, *, secured: bool) -> None:
        self.machines, self.secured = made, secured
        course = endless(len(ROBOTS))
        world = replace(course.world, spares=(SpareRobot(SPARE, (-12.0, -3.0, 0.0)),))
        course = replace(course, world=world, mission=replace(course.mission, control_hz=20.0))
        (made.folder / "endless.toml").write_text(toml(course))
        own = {name: {"python": str(python_with(ROOT / ".namespace", made.folder / f"venv-{name}"))} for name in "abcd"}
        self.file = str(made.write('scenario = "endless.toml"', own, '[robots]\nspread = ["b", "c", "d"]'))
        self.keys = ("--keys", str(made.home / ".local/state/lfa/convoy.keys/issued"))

    def on(self, name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Say a command on one of the fleet's machines, at its own router."""
        there = self.machines.part(name).socket
        return self.machines.lfa(*arguments, "--fleet", "convoy", "--connect", there, on=self.machines.host(name))

    def from_afar(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Say a command on the operator's machine, at the router of machine b."""
        door = ("--connect", f"tls/{self.machines.address('b')}:{PORT}")
        return self.machines.lfa_from_afar(*arguments, "--fleet", "convoy", *door, *self.keys)

    def chain(self) -> list[int]:
        """Return the chain once it is whole: one robot has joined for the one that has retired."""
        with onlooker(self.machines, WORLD, ROBOTS) as look:
            look.wait(lambda: len(look.chain()) == len(ROBOTS), "not whole", PATIENCE_S)
            return list(look.chain())


@pytest.fixture(scope="module", params=[True, pytest.param(False, marks=pytest.mark.long)], ids=["secured", "plain"])
def fleet(request: pytest.FixtureRequest) -> Iterator[Operated]:
    with machines(4) as made:
        operated = Operated(made, secured=request.param)
        secure = ["--secure"] if request.param else []
        done = made.lfa("up", operated.file, "--wait", WAIT_S, *secure, timeout_s=PATIENCE_S)
        assert done.returncode == 0, done.stderr
        yield operated
        made.lfa("down", operated.file)


def _said(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.strip()


def _refused(done: subprocess.CompletedProcess[str]) -> str:
    (line,) = done.stderr.splitlines()
    assert (done.returncode, done.stdout) == (2, "")
    return line


def _everybody(*robots: int) -> str:
    return ", ".join(f"robot{robot}" for robot in sorted(robots))


def test_e28_a_stop_said_on_any_machine_or_from_afar_reaches_every_robot_and_so_does_resume(fleet: Operated) -> None:
    everybody = _everybody(*ROBOTS, SPARE)
    assert _said(fleet.on(WORLD, "stop")) == f"stopped: {everybody} (epoch 1)"
    assert _said(fleet.from_afar("resume")) == f"may go: {everybody} (epoch 2)"
    assert _said(fleet.from_afar("stop")) == f"stopped: {everybody} (epoch 3)"
    assert _said(fleet.on("c", "resume")) == f"may go: {everybody} (epoch 4)"
    assert _refused(fleet.on("d", "resume")) == "lfa: resume: none of the 7 robots that answer is stopped"


def test_e28_a_stopped_robot_is_told_by_the_others_when_it_restarts(fleet: Operated) -> None:
    _said(fleet.on("d", "stop"))
    assert "was started again" in _said(fleet.machines.lfa_from_afar("restart", "robot5", fleet.file))
    assert "robot5" in _said(fleet.from_afar("stop")).partition("NOT")[0]
    assert _said(fleet.on("b", "resume")).startswith(f"may go: {_everybody(*ROBOTS, SPARE)}")


@pytest.mark.parametrize("words", ["pause", "go", "go 3 -1", "set cruise_mps=0.2", "home", "formation column"])
def test_e32_an_order_on_any_machine_is_carried_out_by_the_leader_on_its_own(fleet: Operated, words: str) -> None:
    said = _said(fleet.from_afar(*words.split()) if "go" in words else fleet.on(WORLD, *words.split()))
    assert re.search(r"carried out by robot\d, \d+ robots know it|formation", said), said


@pytest.mark.parametrize(
    "words", ["go nan 1", "go 5000 0", "set cruise_mps=99", "join 2", "retire 7", "restart robot77"]
)
def test_what_cannot_be_is_refused_in_one_line_from_afar_too(fleet: Operated, words: str) -> None:
    _refused(fleet.from_afar(*words.split()))


def test_e33_e34_a_spare_joins_and_robots_retire_from_other_machines_than_their_own(fleet: Operated) -> None:
    leader = fleet.chain()[0]
    assert f"robot{SPARE} is in the team" in _said(fleet.on("b", "join", str(SPARE)))
    assert f"robot{leader} is out of the team" in _said(fleet.from_afar("retire", str(leader)))
    assert SPARE in fleet.chain() and leader not in fleet.chain()


def test_logs_states_and_metrics_of_every_machine_are_read_from_afar(fleet: Operated) -> None:
    far = fleet.machines.lfa_from_afar
    assert "robot6 " in _said(far("logs", "robot6", fleet.file))
    states = json.loads(_said(far("ps", fleet.file, "--json")))["processes"]
    assert {row["state"] for row in states} == {"running"}
    assert len(states) == 4 + 1 + len(ROBOTS) + 1
    metrics = _said(fleet.from_afar("metrics", "--once"))
    assert {f'lfa_pose_age_seconds{{robot="robot{robot}"}}' in metrics for robot in (*ROBOTS, SPARE)} == {True}


def test_why_names_a_killed_leader_from_the_journals_of_all_machines(fleet: Operated) -> None:
    made, run = fleet.machines, fleet.machines.folder / "run"
    there = ("--fleet", "convoy", "--connect", made.part(WORLD).socket, "--keys", str(made.state(WORLD) / "keys"))
    recorder = made.lfa_begins("record", *there, "--out", str(run), "--hosts", fleet.file, on=made.host(WORLD))
    try:
        eventually(lambda: (run / EVENTS).is_file(), "nothing is recorded")
        _said(fleet.on("b", "set", "cruise_mps=0.1"))
        eventually(lambda: "order" in (run / EVENTS).read_text(), "the recorder hears nobody")
        leader = fleet.chain()[0]
        agent = ("--id", str(leader))
        found = (one for name in made.names for one in made.processes(name))
        killed = next(one for one in found if set(agent) <= set(one.arguments) and "lfa.agents.cli" in one.arguments)
        assert identity.send_signal(killed, signal.SIGKILL)
        with onlooker(made, WORLD, ROBOTS) as look:
            look.wait(lambda: leader in look.chain()[1:], "the killed one does not come back", PATIENCE_S)
    finally:
        recorder.send_signal(signal.SIGTERM)
        said = "".join(recorder.communicate(timeout=60.0))
    why = _said(made.lfa("why", str(run), "--of", "leader-change"))
    assert f"robot {leader} died" in why, why + said


def test_e35_an_upgrade_waits_for_who_has_joined_and_not_for_who_has_retired(fleet: Operated) -> None:
    made = fleet.machines
    chain = set(fleet.chain())
    with onlooker(made, "abcd", ROBOTS) as look:
        upgrade = made.lfa_begins("upgrade", fleet.file, "--wait", WAIT_S, "--json")
        try:
            look.wait(lambda: upgrade.poll() is not None, "it does not end", PATIENCE_S)
        finally:
            upgrade.kill()
            out, err = upgrade.communicate()
        check_terms_in(look.events)
    assert (upgrade.returncode, sorted(json.loads(out)["upgraded"])) == (0, list("abcd")), err
    assert set(fleet.chain()) == chain
    assert [made.part(name).secure for name in made.names] == [fleet.secured] * 4
