"""`lfa bench controllers`: every installed controller on the same seeds, ranked, with a page of its own."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from lfa.agents.following.controller import CONTROLLERS
from lfa.deploy.bench import controllers
from lfa.deploy.bench.harness.kept import Keep
from lfa.deploy.campaign.folder import open_folder
from lfa.deploy.campaign.items import ItemResult
from lfa.deploy.campaign.sweep.runs import SweepResult, describe, items_of

ERROR_M = {"law": 0.01, "kanayama": 0.03, "headway": 0.02}


@pytest.fixture
def done(tmp_path: Path) -> Path:
    """Folder with results of every run of two seeds, whose errors are those of `ERROR_M`."""
    plan = controllers.plan_for(2)
    items = items_of(plan)
    kept = open_folder(tmp_path, describe(plan, items))
    for n, item in enumerate(items):
        group = plan.groups[n // 2]
        error = ERROR_M.get(group.values[0], 1.0) * (1.0 + n % 2)
        metrics = {"distance_error_rms_m": error, "separation_min_m": 1.0 - error, "hop_l2": 1.1, "hop_linf": 1.2}
        kept.store(item.name, ItemResult(msgspec.to_builtins(SweepResult("time_limit", True, metrics))))
    return tmp_path


def test_every_installed_controller_drives_the_same_seeds_with_and_without_loss() -> None:
    groups = controllers.plan_for(3).groups
    assert {group.values for group in groups} == {(n, loss) for n in CONTROLLERS.installed() for loss in ("0", "0.2")}


def test_the_leaderboard_ranks_by_the_error_under_loss(done: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert controllers.run(as_json=True, seeds=2, keep=Keep(done)) == 0
    board = msgspec.json.decode(capsys.readouterr().out)["rows"]
    names = [row["controller"] for row in board if row["loss"] == "0.2"]
    assert [name for name in names if name in ERROR_M] == ["law", "headway", "kanayama"]
    assert board[0]["worst_spacing_m"] == pytest.approx(0.98)
    assert "Leaderboard" in (done / "merged" / "index.html").read_text()
