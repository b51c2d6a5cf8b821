"""`lfa bench operate` in short: one run of each of its figures holds its bar."""

from __future__ import annotations

import pytest

from lfa.deploy.bench.operate.figures import run


@pytest.mark.parametrize("rows", ["stop/chain of 4", "stop/12 robots, 60*", "go/leader killed"])
def test_one_run_holds_the_bar(rows: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(False, rows, 1) == 0, capsys.readouterr().out
    assert "0 below the bar" in capsys.readouterr().out
