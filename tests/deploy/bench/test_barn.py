"""`lfa bench barn`: the benchmark's score, worlds from a file, and one line for a file that is none."""

from __future__ import annotations

from math import inf
from pathlib import Path

import msgspec
import pytest

from lfa.deploy.bench import barn
from lfa.deploy.bench.harness.way_past import way_exists
from lfa.protocol.errors import Refused
from lfa.world.description.load import load

FIELD = barn.BarnWorlds(
    (-2.25, 3.0, 1.57), (-2.25, 13.0), 1.0, 100.0, 0.075,
    (barn.BarnWorld(0, 10.0, ((-4.425, 0.075), (-2.0, 6.0), (-0.075, 3.0))),),
)  # fmt: skip


def test_a_file_of_worlds_is_read_and_each_is_a_scenario_that_loads(tmp_path: Path) -> None:
    path = tmp_path / "worlds.json"
    path.write_bytes(msgspec.json.encode(FIELD))
    field = barn.read(path)
    assert field == FIELD
    scenario = tmp_path / "barn_0.toml"
    scenario.write_text(barn.scenario_text(field, field.worlds[0]))
    for team in barn.TEAMS:
        world = load(str(scenario), team.sets).world
        assert [tuple(one.center_m) for one in world.obstacles] == [(-2.0, 6.0)], "the rim is walls"
        assert len(world.walls_m) == 3


def test_the_time_counts_from_the_first_tenth_of_a_metre_to_the_goals_circle() -> None:
    truth = [(0.0, -2.25, 3.0), (1.0, -2.25, 3.05), (2.0, -2.25, 3.2), (7.0, -2.25, 12.1), (9.0, -2.25, 13.0)]
    assert barn.time_s(truth, FIELD) == 5.0
    assert barn.time_s(truth[:3], FIELD) == inf


def test_the_score_is_the_benchmarks() -> None:
    assert barn.score_of(10.0, 5.0) == 0.5, "no faster than twice the shortest time counts"
    assert barn.score_of(10.0, 20.0) == 0.25
    assert barn.score_of(10.0, inf) == 0.125


@pytest.mark.parametrize(
    ("content", "says"), [(b"{", "must be BARN worlds"), (b"{}", "must be BARN worlds"), (None, "worlds.json")]
)
def test_a_file_that_is_none_is_refused_in_one_line(tmp_path: Path, content: bytes | None, says: str) -> None:
    path = tmp_path / "worlds.json"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(Refused, match=says) as refused:
        barn.read(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("gap_m", "way"), [(0.9, True), (0.45, False)])
def test_a_way_past_a_dead_robot_exists_where_a_robot_fits(gap_m: float, way: bool) -> None:
    """A dead robot in a row of posts, with one gap beside it, as wide as told between its edges."""
    y, radius = 5.0, 0.075
    dead = (-2.0, y, barn.RADIUS_M)
    left = [(dead[0] - barn.RADIUS_M - n * 0.2, y, radius) for n in range(1, 12)]
    right = [(dead[0] + barn.RADIUS_M + gap_m + radius + n * 0.2, y, radius) for n in range(8)]
    assert way_exists((-2.0, 4.0), FIELD.goal, [dead, *left, *right], barn.CORRIDOR, barn.RADIUS_M) is way


def test_the_published_baseline_stands_beside_the_teams() -> None:
    assert list(barn.baseline().measure()) == [0.85, 0.159]


@pytest.mark.parametrize(("passable", "good"), [(True, 0.0), (False, 1.0)])
def test_a_run_whose_dead_leader_leaves_no_way_does_not_count_against_the_team(
    monkeypatch: pytest.MonkeyPatch, passable: bool, good: float
) -> None:
    ended = barn.BarnOutcome(0.0, "not at the goal after 100 s", contact=False, passable=passable)
    monkeypatch.setattr(barn, "outcome", lambda *_: ended)
    killed = next(team for team in barn.TEAMS if team.faults)
    assert barn.result(killed, FIELD, FIELD.worlds[0], Path()) == [good, 0.0]
    whole = next(team for team in barn.TEAMS if not team.faults and not team.scored)
    assert barn.result(whole, FIELD, FIELD.worlds[0], Path()) == [0.0, 0.0]


@pytest.mark.parametrize(("index", "score"), [(237, 0.45), (243, 0.4)])
def test_a_robot_comes_fast_through_a_world_of_gaps_that_are_closed_when_it_sees_them(
    index: int, score: float, tmp_path: Path
) -> None:
    try:
        field = barn.read(barn.found())
    except Refused:
        pytest.skip("no shared/data/barn beside the checkout or above it")
    [world] = [world for world in field.worlds if world.index == index]
    done = barn.outcome(barn.TEAMS[0], field, world, tmp_path)
    assert (done.wrong, done.contact) == (None, False), f"reproduce: lfa bench barn --rows 'barn/one/*', world {index}"
    assert done.score >= score
