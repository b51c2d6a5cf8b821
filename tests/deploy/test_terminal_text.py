"""Foreign text on the terminal is text: no markup is obeyed, no control character reaches the terminal."""

from __future__ import annotations

import ast
import io
import json
from pathlib import Path
from typing import Any

import msgspec
import pytest
from rich.console import Console

from lfa.deploy.client.team_status import RobotStatus
from lfa.deploy.command_line import print_errors
from lfa.deploy.fleet import ps
from lfa.deploy.terminal_text import print_visible
from lfa.deploy.view.terminal import watch
from lfa.protocol.output import visible

DEPLOY = Path(__file__).parents[2] / "deploy"

HOSTILE = (
    "ok [/red] x",
    "[link=file:///etc/passwd]click[/link]",
    "\x1b]0;pwned\x07\x1b[2J",
    "a\u202eb",
    "\x9b2J",
    "x\r\ny",
)


def _printed(what: Any) -> str:
    console = Console(width=200, file=io.StringIO(), force_terminal=True, color_system=None)
    console.print(what)
    written: str = console.file.getvalue()  # type: ignore[attr-defined]
    return written


@pytest.mark.parametrize("says", HOSTILE)
@pytest.mark.parametrize("field", ["host", "process", "state", "says", "ended"])
def test_ps_shows_a_hostile_text_as_text(says: str, field: str) -> None:
    row = {
        "host": "a",
        "process": "robot3",
        "state": "running",
        "pid": 1,
        "starts": 1,
        "up_s": 1.0,
        "says": "",
        "ended": "",
    }
    if field == "ended":
        row["state"] = "failed"
    written = _printed(ps.table([{**row, field: says}]))
    assert visible(says) in written
    assert not set(written.replace("\n", "")) & set("\x1b\x07\x9b\u202e\r")


def test_ps_counts_what_was_refused_of_a_member_once_something_was() -> None:
    row = {"host": "a", "process": "robot3", "state": "running", "pid": 1, "starts": 1, "up_s": 1.0, "says": ""}
    quiet, loud = ({**row, "ended": "", "refused": number} for number in (0, 1400))
    assert "refused" not in _printed(ps.table([quiet]))
    assert "1400" in _printed(ps.table([quiet, loud]))
    others = ps.others_refused({"robot3": 1400, "operator\x1b[2J": 2}, [loud])
    assert others == ["2 messages or tokens of operator\\x1b[2J refused"]


@pytest.mark.parametrize("says", HOSTILE)
def test_watch_shows_a_hostile_state_as_text(says: str) -> None:
    row = RobotStatus(1, "leader", 7, None, None, None, 0.0, 0.1, says, None, None, None)
    assert visible(says) in _printed(watch._table([row], None, 160))


@pytest.mark.parametrize("text", ["plain", "Größe 3 °", "a\tb"])
def test_what_is_printable_stays(text: str) -> None:
    assert visible(text) == text


def test_a_control_character_is_written_out() -> None:
    assert visible("\x1b[2J") == r"\x1b[2J"


@pytest.mark.parametrize("text", HOSTILE)
def test_a_command_shows_hostile_words_of_its_command_line_as_text(
    text: str, capfd: pytest.CaptureFixture[str]
) -> None:
    print_errors("lfa", f"{text}: no finished run")
    print_visible(f"run folder: {text}")
    out, err = capfd.readouterr()
    assert not set((out + err).replace("\n", "")) & set("\x1b\x07\x9b\u202e\r")


@pytest.mark.parametrize("text", [*HOSTILE, "\x7f", "\U000e0001", "\u2028"])
def test_json_whose_hostile_texts_are_made_visible_still_holds_them(text: str) -> None:
    printed = visible(msgspec.json.encode({"reason": text}).decode())
    assert json.loads(printed) == {"reason": text}
    assert printed.isprintable()


SHOWN_OTHERWISE = ("bench", "examples", "terminal_text.py", "campaign/progress.py")
"""Parts of `deploy` with a plain print: what they print is their own, no text of others."""


def test_no_command_prints_without_making_its_text_visible() -> None:
    plain = [
        f"deploy/{path.relative_to(DEPLOY)}:{node.lineno}"
        for path in sorted(DEPLOY.rglob("*.py"))
        if not str(path.relative_to(DEPLOY)).startswith(SHOWN_OTHERWISE)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("print", "typer.echo")
    ]
    assert not plain, f"print_visible (deploy/terminal_text.py) is what these need: {plain}"
