"""Situations that users met: each team comes through whole, without a contact, within its scenario's time.

The scenarios are read from `shared/cases`, beside the checkout or above it, with the seeds that showed the fault;
without them the tests are skipped. A few run in each `make test`; `make test-driving` runs all.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from lfa.deploy.run.simulate import run
from lfa.world.description.load import load

CASES = Path("shared") / "cases"

#   scenario                                                        seed
SHORT = (
    ("1_nose_at_a_post/1_nose_at_a_post.toml",                      1),
    ("3_gap_called_walled_in/3_gap_called_walled_in.toml",          1),
    ("driving/e_gap0.7_0.0_left_path.toml",                         10001),
    ("driving/c_head_0.3_path.toml",                                10003),
    ("driving/c_left_0.1_path.toml",                                10001),
)  # fmt: skip
LONG = (
    ("driving/e_kd0.5_left.toml",                                   10001),
    ("2_team_leader_killed/2_team_leader_killed.toml",              1),
    ("driving/c_head_0.3_expl.toml",                                10003),
    ("driving/c_over_0.6_path.toml",                                10004),
    ("driving/d_04.toml",                                           10005),
    ("driving/c_stopgo_path.toml",                                  10006),
    ("driving/e_n8.toml",                                          10001),
    ("driving/e_door_path.toml",                                    10001),
    ("driving/e_utrap_path.toml",                                   10001),
    ("driving/e_utrapdeep_path.toml",                               10001),
)  # fmt: skip


def through(name: str, seed: int, folder: Path) -> None:
    above = (*Path.cwd().parents, *Path(__file__).resolve().parents)
    path = next((found for up in above if (found := up / CASES / name).is_file()), None)
    if path is None:
        pytest.skip(f"no {CASES / name} beside the checkout or above it")
    summary = run(load(str(path)), seed, folder).summary
    contacts = {robot.id: robot.contacts for robot in summary.robots if robot.contacts}
    found = (summary.outcome, summary.left_behind, contacts, summary.exit_code)
    assert found == ("goal_reached", [], {}, 0), f"{summary.reason or ''}; reproduce: lfa sim {path} --seed {seed}"


@pytest.mark.parametrize(("name", "seed"), SHORT)
def test_the_team_comes_through_whole(name: str, seed: int, tmp_path: Path) -> None:
    through(name, seed, tmp_path / "run")


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "seed"), LONG)
def test_the_team_comes_through_whole_where_it_takes_long(name: str, seed: int, tmp_path: Path) -> None:
    through(name, seed, tmp_path / "run")
