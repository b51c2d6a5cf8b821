"""`lfa diff`: the first tick and the first process that differ."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfa.deploy.lockstep.diff_command import Divergence, command, compare
from lfa.protocol.errors import Refused
from lfa.protocol.runtime.state_hashes import HASHES

HEAD = "tick time_s world robot1 robot2\n"


def _run(folder: Path, *rows: str) -> Path:
    folder.mkdir()
    (folder / HASHES).write_text(HEAD + "".join(f"{n} {0.02 * n:.6f} {row}\n" for n, row in enumerate(rows)))
    return folder


def test_the_process_with_the_same_inputs_and_other_outputs_differs_first(tmp_path: Path) -> None:
    a = _run(tmp_path / "a", "0/0 0/0 0/0", "1/1 1/1 1/1", "2/2 2/2 2/2", "3/3 3/3 3/3")
    b = _run(tmp_path / "b", "0/0 0/0 0/0", "1/1 1/1 1/1", "9/2 9/2 2/9", "9/9 9/9 9/9")
    assert compare(a, b) == Divergence((4, 4), 2, 0.04, ("robot2",), ("world", "robot1"))


def test_a_process_that_runs_in_one_run_only_differs_first(tmp_path: Path) -> None:
    a = _run(tmp_path / "a", "0/0 0/0 0/0", "1/1 - 1/1")
    b = _run(tmp_path / "b", "0/0 0/0 0/0", "8/1 1/1 1/1")
    assert compare(a, b).first == ("robot1",)


def test_a_run_that_goes_on_longer_is_the_same_so_far(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = _run(tmp_path / "a", "0/0 0/0 0/0"), _run(tmp_path / "b", "0/0 0/0 0/0", "1/1 1/1 1/1")
    assert command(a, b) == 1
    assert capsys.readouterr().out == f"the same in all 1 ticks; {b} goes on\n"
    assert command(b, b) == 0


def test_a_file_that_ends_within_a_row_counts_up_to_its_last_whole_one(tmp_path: Path) -> None:
    a, b = _run(tmp_path / "a", "0/0 0/0 0/0", "1/1 1/1"), _run(tmp_path / "b", "0/0 0/0 0/0")
    assert compare(a, b) == Divergence((1, 1))


@pytest.mark.parametrize("content", [None, b"", b"\xff\xfe", b"some other file\n"])
def test_what_is_no_run_is_refused(content: bytes | None, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / HASHES).write_bytes(content)
    with pytest.raises(Refused, match=HASHES):
        compare(tmp_path, tmp_path)
