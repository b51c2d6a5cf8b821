"""Golden traces: who says what to whom and when, in elections and hand-overs that a reader can follow.

A trace that differs is a change of behaviour: explain it in the commit, or mend the code. To accept it:
`.venv/bin/pytest tests/protocol/lease/traces --rewrite-traces`, then read the difference.
"""

from __future__ import annotations

from difflib import unified_diff
from pathlib import Path

import pytest

from tests.protocol.lease.traces.script import play

SCRIPTS = sorted(Path(__file__).parent.glob("*.txt"))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_the_trace_is_what_it_was(script: Path, request: pytest.FixtureRequest) -> None:
    before, today = script.read_text(), play(script)
    if request.config.getoption("--rewrite-traces"):
        script.write_text(today)
        return
    different = "\n".join(unified_diff(before.splitlines(), today.splitlines(), "kept", "today", lineterm=""))
    assert not different, f"{script.name}: .venv/bin/pytest tests/protocol/lease/traces -k {script.stem}\n{different}"


def test_there_are_at_least_twenty_traces_and_each_says_why() -> None:
    assert len(SCRIPTS) >= 20
    assert all(script.read_text().startswith("# ") for script in SCRIPTS)
