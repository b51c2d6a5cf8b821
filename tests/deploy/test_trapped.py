"""A leader in a dead end that its own team closes: it hands over, the others go on, and it follows at the tail."""

from __future__ import annotations

import pytest

from deploy.look import chronicle
from deploy.look.summary import Summary
from deploy.run.simulate import run
from world.scenario import load

HANDOVER_S = 10.0
Trapped = tuple[Summary, list[chronicle.Line]]


@pytest.fixture(scope="module")
def trapped(tmp_path_factory: pytest.TempPathFactory) -> Trapped:
    ended = run(load("dead_end"), 1, tmp_path_factory.mktemp("trapped") / "run")
    return ended.summary, chronicle.lines(ended.folder)


def test_the_trapped_leader_hands_over_within_ten_seconds(trapped: Trapped) -> None:
    summary, events = trapped
    met = next(e["t"] for e in chronicle.of_kind(events, "decision") if e["robot"] == 1)
    stuck = next(e for e in chronicle.of_kind(events, "stuck") if e["robot"] == 1)
    assert stuck["reason"].startswith("S2"), "lfa sim dead_end --seed 1"
    assert [(reign.robot_id, reign.cause) for reign in summary.leaders] == [(1, "start"), (2, "handed_over")]
    assert summary.leaders[1].from_s - met <= HANDOVER_S


def test_it_is_left_out_while_it_is_stuck_and_comes_in_again_at_the_tail(trapped: Trapped) -> None:
    _, events = trapped
    chains = [e["chain"] for e in chronicle.of_kind(events, "chain") if e["robot"] == 2]
    assert [2, 3, 4] in chains
    assert chronicle.last_chain(events) == [2, 3, 4, 1]


def test_all_four_reach_the_goal_without_contact(trapped: Trapped) -> None:
    summary, _ = trapped
    assert summary.outcome == "goal_reached", "lfa sim dead_end --seed 1"
    assert summary.left_behind == []
    assert sum(robot.contacts for robot in summary.robots) == 0
    assert summary.violations == []
