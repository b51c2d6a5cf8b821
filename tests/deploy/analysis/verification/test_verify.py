"""`lfa verify` finds nothing in a sound run, and finds what is planted."""

from __future__ import annotations

import shutil
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from lfa.deploy.analysis.verification import command, journals
from lfa.deploy.faults.script import parse_all
from lfa.deploy.run.simulate import run
from lfa.protocol.errors import Refused
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.messages.codec import decode
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.runtime import journal
from lfa.world.description.load import load

SHORT = ("mission.leading.route_m=[[2.0, 0.0]]", "faults=[]")
FAULTS = ("kill leader at 2 s", "stop leader at 3 s for 1 s")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run in which one leader is killed, and the next is stopped and wakes up late."""
    scenario = load("leader_killed", SHORT)
    faults = parse_all(scenario.mission, (), FAULTS)
    return run(scenario, 3, tmp_path_factory.mktemp("verify") / "run", faults).folder


def test_a_sound_run_has_no_violation(folder: Path) -> None:
    verdict = journals.verify(folder)
    assert verdict.broken == (), f"reproduce: lfa verify {folder}"
    assert verdict.journals == 6
    assert verdict.happenings > 1000


@pytest.mark.parametrize("lost", ["robot3", "world"])
def test_a_run_without_the_journal_of_one_that_took_part_is_refused(folder: Path, tmp_path: Path, lost: str) -> None:
    part = Path(shutil.copytree(folder, tmp_path / "part"))
    (part / "journal" / f"{lost}-1.bin").unlink()
    with pytest.raises(Refused, match=f"no journal of {lost}"):
        journals.verify(part)


def test_so_is_one_without_the_journal_of_one_that_came_and_said_nothing(folder: Path, tmp_path: Path) -> None:
    part = Path(shutil.copytree(folder, tmp_path / "part"))
    with (part / "events.jsonl").open("a") as events:  # as the recorder of `lfa run` tells it
        events.write(
            '{"t":0.0,"robot":7,"term":null,"kind":"peer_up","from":"recorder","name":"robot7","incarnation":1}\n'
        )
    with pytest.raises(Refused, match="no journal of robot7"):
        journals.verify(part)


def test_an_old_leaders_command_is_harmless_unless_a_gateway_obeys_it(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    late = tmp_path / "late"
    shutil.copytree(folder, late)
    _come_again(next((late / "journal").glob("world-*.bin")))
    assert journals.verify(late).broken == ()
    monkeypatch.setattr(Gateway, "_objection", lambda *_: None)
    assert {"I2"} <= {violation.name for violation in journals.verify(late).broken}


def _come_again(world: Path) -> None:
    """The first leader command of the run reaches the world once more, at its end."""
    _, entries = journal.read(world)
    known = list(entries)
    first = next(e for e in known if e.key.endswith("cmd_vel") and decode(e.payload, CmdVel).as_leader)  # type: ignore[union-attr]
    body = msgspec.msgpack.encode(replace(first, at=known[-1].at + 0.01))
    with world.open("ab") as file:
        file.write(len(body).to_bytes(4, "little") + body)


def test_a_part_of_a_run_of_the_paper_is_not_measured_by_its_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ran = run(load("paper_path1", ["time_limit_s=2.0"]), 1, tmp_path / "part", ()).folder
    shutil.rmtree(ran / "journal")  # as `lfa record` leaves it
    kept = ran / "summary.json"
    kept.write_text(kept.read_text().replace('"time_limit"', '"recorded"', 1))
    assert command.command([ran]) == 0
    assert "the paper's figures are those of a whole run, and are not checked" in capsys.readouterr().out


def test_a_folder_without_journals_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Refused, match="no journals"):
        journals.verify(tmp_path)
