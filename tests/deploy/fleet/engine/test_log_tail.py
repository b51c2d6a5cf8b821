"""Lines of a log as they come, each once and whole."""

from __future__ import annotations

from pathlib import Path

from lfa.deploy.fleet.engine.log_tail import FOLLOW_S, LINE_CHARACTERS_MAX, FileTail


def test_the_last_lines_come_first_and_then_what_is_written(tmp_path: Path) -> None:
    log = tmp_path / "robot1.log"
    log.write_text("one\ntwo\nthree\n")
    tail = FileTail(log, 2, 0.0)
    assert tail.take(0.0) == ("two", "three")
    assert tail.take(0.1) == ()
    with log.open("a") as file:
        file.write("four\nfi")
        file.flush()
        assert tail.take(0.2) == ("four",)
        file.write("ve\n")
        file.flush()
        assert tail.take(0.3) == ("five",)


def test_a_log_that_is_not_there_yet_is_empty(tmp_path: Path) -> None:
    tail = FileTail(tmp_path / "late.log", 5, 0.0)
    assert tail.take(0.0) == ()
    (tmp_path / "late.log").write_text("at last\n")
    assert tail.take(0.1) == ("at last",)


def test_what_is_no_text_and_what_is_too_long_does_no_harm(tmp_path: Path) -> None:
    log = tmp_path / "robot1.log"
    log.write_bytes(b"\xff\x00\n" + b"x" * (LINE_CHARACTERS_MAX + 5) + b"\n")
    lines = FileTail(log, 5, 0.0).take(0.0)
    assert len(lines) == 2
    assert len(lines[1]) == LINE_CHARACTERS_MAX


def test_it_is_over_unless_somebody_asks_again(tmp_path: Path) -> None:
    tail = FileTail(tmp_path / "robot1.log", 5, 0.0)
    assert not tail.over(FOLLOW_S)
    assert tail.over(FOLLOW_S + 0.1)
    tail.prolong(FOLLOW_S)
    assert not tail.over(2.0 * FOLLOW_S)
