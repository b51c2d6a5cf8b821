"""`lfa why`: faults drawn from seeds are named by their traces, and bad input is one line. All forty: `make why`."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lfa.deploy.analysis.causes import rules
from lfa.deploy.analysis.causes.command import command, lines, why
from lfa.deploy.analysis.causes.fact import Fact
from lfa.protocol.errors import Refused
from tests.deploy.analysis.causes.drawn_faults import drawn, explained, objections

KINDS = (*range(8), 44)
"""Seeds of one fault of each kind; the last is a driver that hangs, and with it all that it reads."""


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run in which robot 1, the leader, is killed."""
    folder = tmp_path_factory.mktemp("why") / "run"
    explained(drawn(0), folder)
    return folder


@pytest.mark.parametrize("seed", KINDS[1:])
def test_a_drawn_fault_is_named_and_no_other(seed: int, tmp_path: Path) -> None:
    fault = drawn(seed)
    found = explained(fault, tmp_path / "run")
    again = f"python -m tests.deploy.analysis.causes.drawn_faults {seed} {seed + 1}"
    assert objections(fault, found) == [], "\n".join([fault.fault, *lines(found), again])


def test_a_killed_leader_explains_the_change_in_one_step(killed: Path) -> None:
    found = why(killed)
    (change,) = [chain for chain in found.chains if chain.effect.kind == "leader change"]
    assert [fact.kind for fact in change.facts] == ["died", "leader change"]
    assert "robot4 saw its token vanish" in change.facts[0].evidence
    assert found.without_effect == ()


def test_the_announcement_of_a_fault_is_not_read(killed: Path, tmp_path: Path) -> None:
    blind = tmp_path / "run"
    shutil.copytree(killed, blind)
    events = blind / "events.jsonl"
    events.write_text("".join(line for line in events.read_text().splitlines(True) if '"fault"' not in line))
    assert why(blind).chains == why(killed).chains


def test_the_effect_nearest_to_a_time_is_shown(killed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(killed, "leader-change", 5.0) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0].startswith("leader change at 4.3")
    assert len(out) == 2


@pytest.mark.parametrize(("of", "at"), [("death", None), ("stop", 1e9), (None, -50.0), (None, float("nan"))])
def test_what_is_not_there_is_refused_in_one_line(killed: Path, of: str | None, at: float | None) -> None:
    with pytest.raises(Refused, match="must be"):
        command(killed, of, at)


@pytest.mark.parametrize("missing", ["journal", "recording.mcap", "scenario.toml"])
def test_a_folder_without_a_part_of_the_run_is_refused(killed: Path, tmp_path: Path, missing: str) -> None:
    part = tmp_path / "run"
    shutil.copytree(killed, part)
    gone = part / missing
    shutil.rmtree(gone) if gone.is_dir() else gone.unlink()
    with pytest.raises(Refused):
        why(part)


def test_a_cause_never_begins_after_its_effect() -> None:
    stop = Fact(5.0, "stop", "robot2", "robot 2 stood", other="robot1")
    late = Fact(5.5, "died", "robot2", "robot 2 died")
    early = Fact(4.5, "died", "robot1", "robot 1 died")
    assert rules.explain(stop, [early, stop, late]).root == early


def test_without_a_cause_none_is_made_up() -> None:
    stop = Fact(5.0, "stop", "robot2", "robot 2 stood")
    assert rules.explain(stop, [stop]).root is None


def test_the_shortest_chain_to_a_root_wins() -> None:
    died = Fact(1.0, "died", "robot1", "robot 1 died")
    ahead = Fact(1.4, "stop", "robot1", "robot 1 stood")
    behind = Fact(2.0, "stop", "robot2", "robot 2 stood", other="robot1")
    assert rules.explain(behind, [died, ahead, behind]).facts == (died, behind)
    last = Fact(6.0, "stop", "robot3", "robot 3 stood", other="robot2")
    assert rules.explain(last, [ahead, behind, last]).facts[-2:] == (behind, last)
