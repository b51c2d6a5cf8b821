"""`lfa verify` on the paper's runs: spikes and their reasons, and a verdict that a planted fault turns."""

from __future__ import annotations

import json
from math import hypot, isnan
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from lfa.agents.avoidance.detour import Detour
from lfa.agents.avoidance.moving_obstacle import Crossing
from lfa.deploy.analysis import episodes
from lfa.deploy.analysis.known_obstacles import known_obstacles
from lfa.deploy.analysis.paper import across_seeds
from lfa.deploy.analysis.paper.across_seeds import Kept
from lfa.deploy.analysis.paper.checks import PROPERTIES, of_run
from lfa.deploy.analysis.paper.criteria import Bar, Measured
from lfa.deploy.analysis.paper.experiment import Subject, duration_s
from lfa.deploy.analysis.run_data import Run
from lfa.deploy.analysis.tracking_errors import TrackingErrors
from lfa.deploy.analysis.verification.command import command
from lfa.deploy.recording import event_log
from lfa.deploy.run.load import rebuild_scenario
from lfa.deploy.run.simulate import run
from lfa.protocol.errors import Refused
from lfa.world.description.load import load

T = np.arange(0.0, 10.0, 0.02)


def bump(from_s: float, until_s: float, height: float) -> np.ndarray:
    inside = (from_s < T) & (until_s > T)
    return np.where(inside, height * np.sin(np.pi * (T - from_s) / (until_s - from_s)), 0.0)


# --- spikes -------------------------------------------------------------------------------------------------------


def test_a_spike_lasts_from_the_baseline_to_the_baseline_and_has_the_peak_of_its_magnitude() -> None:
    (found,) = episodes.spikes(2, T, bump(2.0, 5.0, -0.3), episodes.BASE_M, episodes.SPIKE_M)
    assert (found.from_s, found.until_s) == pytest.approx((2.06, 4.94), abs=0.03)
    assert found.peak == pytest.approx(0.3, abs=1e-3)


def test_what_stays_under_the_bar_is_no_spike_and_a_swing_through_zero_is_one() -> None:
    assert episodes.spikes(2, T, bump(2.0, 5.0, 0.049), episodes.BASE_M, episodes.SPIKE_M) == []
    both = bump(2.0, 3.0, 0.2) + bump(3.5, 4.5, -0.2)
    assert len(episodes.spikes(2, T, both, episodes.BASE_M, episodes.SPIKE_M)) == 1
    apart = bump(2.0, 3.0, 0.2) + bump(4.5, 5.5, -0.2)
    assert len(episodes.spikes(2, T, apart, episodes.BASE_M, episodes.SPIKE_M)) == 2


class Seen:
    """A run in which robot 2 followed nobody that did anything."""

    errors: ClassVar[dict[int, TrackingErrors]] = {}


@pytest.mark.parametrize(
    ("from_s", "until_s", "counts_s"),
    [(19.0, 24.0, 5.0), (18.0, 40.0, 12.0), (2.0, 24.0, 4.0), (2.0, 16.0, 0.0), (31.0, 40.0, 0.0)],
)
def test_an_avoidance_counts_for_a_spike_as_far_as_it_can_have_made_it(
    from_s: float, until_s: float, counts_s: float
) -> None:
    spike = episodes.Spike(2, 20.0, 30.0, 0.3)
    subject = Subject(Seen())  # type: ignore[arg-type]
    subject.episodes = [episodes.Episode(2, "avoidance", from_s, until_s), episodes.Episode(3, "avoidance", 19.0, 30.0)]
    assert duration_s(subject, spike) == pytest.approx(counts_s)


def test_rank_correlation_is_spearmans() -> None:
    assert episodes.rank_correlation([1, 2, 3, 4], [1, 4, 9, 100]) == pytest.approx(1.0)
    assert episodes.rank_correlation([1, 2, 3, 4], [9, 5, 2, 1]) == pytest.approx(-1.0)
    # By hand: ranks 1, 2.5, 2.5, 4 and 2, 1, 3, 4.
    assert episodes.rank_correlation([1, 2, 2, 3], [2, 1, 3, 4]) == pytest.approx(3.0 / (4.5 * 5.0) ** 0.5)
    assert isnan(episodes.rank_correlation([1, 2], [1, 2]))


# --- bars and comparisons -------------------------------------------------------------------------------------------


def test_a_bar_tells_what_holds_what_fails_what_there_is_none_of_and_what_takes_more_runs() -> None:
    bar = Bar("7", "spikes with an event", ">=", 0.9)
    assert [bar.judged(m).status for m in (Measured(0.9), Measured(0.89), Measured(float("nan")), None)] == [
        "ok", "fails", "does not apply", "needs more runs"]  # fmt: skip


def kept(scenario: str, seed: int, duration_s: float, requests: int = 0, switches: int = 0, iteration: int = 1) -> Kept:
    wide = tuple((float(n), 0.1 * n, float(n)) for n in range(1, 12))
    return Kept(scenario, seed, iteration, duration_s, 2.0 * duration_s, requests, switches, wide)


def statuses(runs: list[Kept]) -> dict[str, str]:
    return {one.name: one.status for one in across_seeds.across(runs)}


def test_one_run_is_too_few_for_every_comparison() -> None:
    assert set(statuses([kept("paper_path1", 1, 60.0)]).values()) == {"needs more runs"}


def test_path_1_has_to_take_longer_in_every_pair_of_equal_seeds() -> None:
    twos = [kept("paper_path2", seed, 50.0) for seed in (1, 2)]
    slow, quick = kept("paper_path1", 1, 60.0, 2, 1), kept("paper_path1", 2, 49.0, 2, 1)
    again = kept("paper_path1", 1, 59.0, iteration=2)
    assert set(statuses([slow, again, *twos]).values()) == {"ok"}
    longer = kept("paper_path1", 1, 61.0, iteration=2)
    assert statuses([slow, longer])["time of iteration 2 in that of iteration 1"] == "fails"
    assert statuses([slow, quick, *twos])["time of path 1 beyond path 2"] == "fails"


# --- runs ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def second_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run(load("paper_path2"), 1, tmp_path_factory.mktemp("shapes") / "run").folder


def test_the_papers_second_path_shows_what_its_figures_must(second_path: Path) -> None:
    failed = [one for one in of_run(Run(second_path)) if one.status == "fails"]
    assert failed == [], "reproduce: lfa sim paper_path2 --seed 1, then lfa verify RUN"


def test_a_follower_goes_round_what_is_in_its_way_and_does_not_turn_round_before_it(second_path: Path) -> None:
    followers = [e for e in event_log.of_kind(event_log.lines(second_path), "decision") if e["robot"] != 1]
    assert "u_turn" not in {e["action"] for e in followers}, "reproduce: lfa sim paper_path2 --seed 1"
    peaks = {spike.peak: spike for spike in Subject(Run(second_path)).distance}
    assert max(peaks) < 0.8, f"{peaks[max(peaks)]}; reproduce: lfa sim paper_path2 --seed 1, then lfa plot RUN"


def test_what_the_robots_met_is_where_it_stands(second_path: Path) -> None:
    known = known_obstacles(second_path)
    true = [obstacle.center_m for obstacle in Run(second_path).scenario.world.obstacles]
    assert len(known) == len(true) == 3
    assert all(min(hypot(x - a, y - b) for a, b in true) < 0.1 and 0.15 < radius < 0.35 for x, y, radius in known)


def test_iteration_2_with_known_obstacles_is_shorter_and_takes_less_time(second_path: Path, tmp_path: Path) -> None:
    chosen, seed = rebuild_scenario("paper_path2", (), None, None, second_path)
    assert seed == 1
    again = run(chosen, seed, tmp_path / "again").folder
    first, second = across_seeds.keep(Run(second_path)), across_seeds.keep(Run(again))
    assert second.iteration == 2
    assert second.way_m <= first.way_m, "reproduce: lfa sim paper_path2 --seed 1, then again with --map-from RUN"
    assert second.duration_s <= first.duration_s
    assert [one for one in of_run(Run(again)) if one.status == "fails"] == []


def test_a_map_from_what_is_no_run_or_for_another_motion_is_refused(second_path: Path, tmp_path: Path) -> None:
    with pytest.raises(Refused, match="no run folder"):
        rebuild_scenario("paper_path2", (), None, None, tmp_path)
    with pytest.raises(Refused, match=r"known_m .* left out without motion"):
        rebuild_scenario("paper_path2", ["mission.leading.motion='point_to_point'"], None, None, second_path)


def test_a_map_from_another_scenarios_run_is_refused(second_path: Path) -> None:
    with pytest.raises(Refused, match=r"--map-from .*: a run of paper_path2, must be one of paper_path1"):
        rebuild_scenario("paper_path1", (), None, None, second_path)
    assert rebuild_scenario(str(second_path / "scenario.toml"), (), None, None, second_path)[1] == 1


def test_with_obstacle_avoidance_switched_off_the_verdict_is_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Detour, "steer", lambda *_: None)
    monkeypatch.setattr(Crossing, "give_way", lambda _self, _moving, _pose, wanted, *_: wanted)
    monkeypatch.setattr("lfa.agents.behaviors.command_limits.safe", lambda wanted, *_: wanted)
    folder = run(load("paper_path2", ["time_limit_s=25"]), 1, tmp_path / "run").folder
    assert command([folder], as_json=True) == 1
    said = json.loads(capsys.readouterr().out)
    assert said["runs"][0]["broken"] == [], "the lease is sound all the same"
    failed = {one["name"] for one in said["runs"][0]["shapes"] if one["status"] == "fails"}
    assert {"goal reached", "contacts"} <= failed
    assert not said["ok"]


def test_a_run_that_is_none_of_the_papers_is_told_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = run(load("straight", ["mission.leading.route_m=[[1.0, 0.0]]"], 2), 1, tmp_path / "run").folder
    assert command([folder], as_json=False) == 0
    said = capsys.readouterr().out
    assert "no scenario of the paper" in said
    assert "needs more runs" not in said


def test_a_folder_whose_run_did_not_end_is_refused(tmp_path: Path) -> None:
    folder = run(load("straight", ["time_limit_s=1"], 2), 1, tmp_path / "run").folder
    (folder / "summary.json").unlink()
    with pytest.raises(Refused, match=r"no summary\.json"):
        command([folder], as_json=False)


def test_every_figure_of_the_paper_has_properties() -> None:
    assert {"7", "8", "9", "11a", "11b", "11c", "11d"} <= {one.bar.figure for one in PROPERTIES}
