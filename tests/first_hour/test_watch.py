"""`lfa watch` fits narrow terminals, and asks before it kills."""

from __future__ import annotations

import io
from types import SimpleNamespace
from typing import Any, cast

import pytest
from msgspec import structs
from rich.console import Console

from lfa.deploy.client.team_status import RobotStatus
from lfa.deploy.view.terminal import watch

ROW = RobotStatus(
    robot=12, role="follower", term=1795960024479, predecessor=11, error_m=-0.123, heading_error_rad=3.0,
    speed_mps=-0.55, pose_age_s=0.123, loop_lag_ms=12.0, cpu_percent=12.0, rss_mib=33.0, state="follow",
)  # fmt: skip


STOPPED = structs.replace(ROW, role="leader", state="leader, stopped: lfa resume lets it go")


def shown(width: int, row: RobotStatus = ROW, *, wraps: bool = False) -> list[str]:
    out = io.StringIO()
    Console(file=out, width=width).print(watch._table([row], None, width, wraps=wraps))
    return [line.rstrip() for line in out.getvalue().splitlines()]


@pytest.mark.parametrize("width", [60, 79, 80, 120])
def test_no_cell_of_the_table_is_cut(width: int) -> None:
    head, row = shown(width)
    assert "…" not in head + row
    assert max(len(head), len(row)) <= width
    assert ("CPU %" in head) is (width >= watch.WIDE)
    assert row.split()[-1] == "follow"


@pytest.mark.parametrize("width", [60, 79, 80, 120])
def test_a_long_state_is_cut_and_no_other_cell(width: int) -> None:
    head, row = shown(width, STOPPED)
    assert head.startswith("robot role   term ahead off mm turn °")
    assert row.split()[:4] == ["12", "leader", "4479", "11"]
    assert "stopp" in row


def test_the_table_printed_once_has_a_long_state_whole() -> None:
    lines = shown(80, STOPPED, wraps=True)[1:]
    assert " ".join(" ".join(lines).split()).endswith("stopped: lfa resume lets it go")


def test_the_keys_are_listed_in_sixty_columns() -> None:
    assert max(map(len, (*watch.KEYS, watch.HELP))) <= 58


@pytest.mark.parametrize(("answer", "killed"), [("y", ["1"]), ("n", []), ("k", []), ("q", [])])
def test_a_kill_is_asked_for(monkeypatch: pytest.MonkeyPatch, answer: str, killed: list[str]) -> None:
    done: list[str] = []
    monkeypatch.setattr(watch.fault, "command", lambda action, target, **_: done.append(target))
    subscriber = SimpleNamespace(fleet=SimpleNamespace(name="fleet", team=(1,)), bus=None)
    hand = watch.KeyHandler(cast(Any, subscriber))
    hand.press("1")
    hand.press("k")
    assert (done, hand.said) == ([], "kill the process of robot 1? y: yes, any other key: no")
    hand.press(answer)
    assert done == killed
    assert (hand.said == "robot 1 is not killed") is (answer in "nq")
