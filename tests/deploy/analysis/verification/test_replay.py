"""`lfa replay --robot`: a core run again on its journal returns the same bytes, and a changed core does not."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from lfa.agents.following import factory
from lfa.deploy.analysis.verification.reexecution import Comparison, compare
from lfa.deploy.analysis.verification.replay import command, journals
from lfa.deploy.faults.script import parse_all
from lfa.deploy.run.simulate import run
from lfa.protocol.errors import Refused
from lfa.protocol.runtime import journal
from lfa.world.description.load import load

FAULTS = ("stop 3 at 1 s for 0.5 s", "kill leader at 2 s", "restart 1 at 3 s")
REPRODUCE = "lfa sim paper_path1 --seed 3 --set time_limit_s=6.0, then lfa replay RUN --robot all"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with obstacles, noise, a freeze, a death and a second life."""
    scenario = load("paper_path1", ["time_limit_s=6.0"])
    made = tmp_path_factory.mktemp("runs") / "run"
    run(scenario, 3, made, parse_all(scenario.mission, (), FAULTS))
    return made


def test_every_life_of_every_node_returns_what_it_returned(folder: Path) -> None:
    lives = journals(folder, "all")
    assert [path.name for path in lives if "robot1" in path.name] == ["robot1-1.bin", "robot1-2.bin"]
    differing = [found for found in map(compare, lives) if not found.equal]
    assert not differing, f"{differing}: {REPRODUCE}"


def test_a_changed_gain_is_seen(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = factory.gains_of
    monkeypatch.setattr(factory, "gains_of", lambda mission: replace(told(mission), k_per_s=1.49))
    found = compare(folder / "journal" / "robot2-1.bin")
    assert found.difference is not None, REPRODUCE
    assert any("cmd_vel" in said for said in found.difference.now_returns)


def test_a_journal_cut_off_is_compared_up_to_its_last_whole_entry(folder: Path, tmp_path: Path) -> None:
    whole = folder / "journal" / "robot4-1.bin"
    cut = tmp_path / whole.name
    cut.write_bytes(whole.read_bytes()[:-3])
    assert compare(cut) == Comparison(cut.name, compare(whole).calls - 1)


def test_a_foreign_file_and_a_strange_robot_are_refused_in_one_line(folder: Path, tmp_path: Path) -> None:
    foreign = tmp_path / "journal" / "robot1-1.bin"
    foreign.parent.mkdir()
    foreign.write_bytes(b"no journal at all")
    with pytest.raises(Refused, match="must be a journal"):
        compare(foreign)
    with pytest.raises(Refused, match=r"--robot 9: .* must be all or one of robot1, robot2"):
        command(folder, robot="9")
    with pytest.raises(Refused, match="must be a run folder"):
        command(tmp_path / "none", robot="1")


def test_a_journal_of_another_version_is_refused(folder: Path, tmp_path: Path) -> None:
    heading, _ = journal.read(folder / "journal" / "robot4-1.bin")
    old = journal.Heading(heading.version + 1, "robot4", 7, heading.floor, heading.config)
    journal.Journal(tmp_path, old).close()
    with pytest.raises(Refused, match="replay it with the lfa of its time"):
        compare(tmp_path / "robot4-7.bin")
