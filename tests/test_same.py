"""`make same` tells what behaves otherwise, and nothing else."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from lfa.deploy.analysis.summary import Summary
from tests import same
from tests.same import LEASES, NO_BEHAVIOUR, Row, differences, read_table, tasks, text

ROW = Row("fuzz", LEASES, "1", "trace", "5a0b48e796c83e10")


def test_a_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "table"
    path.write_text(text([ROW]))
    made_by, rows = read_table(path)
    assert made_by.startswith("lfa ")
    assert rows == [ROW]


def test_another_hash_and_a_row_too_few_are_told() -> None:
    changed, more = ROW._replace(hash="0"), ROW._replace(seed="2")
    assert list(differences([ROW], [ROW])) == []
    assert list(differences([ROW], [changed])) == ["fuzz leases 1 trace: was 5a0b48e796c83e10, is 0"]
    assert list(differences([ROW, more], [ROW])) == ["fuzz leases 2 trace: was 5a0b48e796c83e10, is absent"]


def test_what_no_behaviour_is_changes_no_hash() -> None:
    """A summary names the commit that made it: two commits that behave alike have one hash."""
    for name in NO_BEHAVIOUR:
        assert name in {field.name for field in msgspec.structs.fields(Summary)}
    facts = {"outcome": "goal_reached", "provenance": "one", "duration_s": 1.0}
    assert str(same._of_summary(facts)) == str(same._of_summary(facts | {"provenance": "other", "duration_s": 2.0}))
    assert str(same._of_summary(facts)) != str(same._of_summary(facts | {"outcome": "stuck"}))


def test_a_share_is_chosen_by_name_and_an_unknown_name_is_refused() -> None:
    assert {name for name, _, _ in tasks(None, ["straight", LEASES])} == {"straight", LEASES}
    with pytest.raises(ValueError, match=r"--only strait: must be one of .*straight"):
        tasks(None, ["strait"])


def test_a_replay_that_returns_otherwise_than_recorded_fails_without_any_table(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["same", "--only", LEASES])
    for answer, exit_code in ((ROW.hash, 0), (same.OTHERWISE, 1)):
        replay = Row("replay", "killed", "-", "robot1-1.bin", answer)
        monkeypatch.setattr(same, "rows", lambda *_, replay=replay: [ROW, replay])
        assert same.main() == exit_code
        assert f"{1 - exit_code} of 1 journals return what was recorded" in capsys.readouterr().err
