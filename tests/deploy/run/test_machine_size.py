"""Before `lfa run` starts more processes than the machine carries, it says so with the number, and lowers the rates."""

from __future__ import annotations

import pytest

from lfa.deploy.run.machine_size import FEW_BEAMS, SLOW_HZ, carried, cores, fit_to
from lfa.protocol.mission import Mission
from lfa.world.description.load import Scenario, load

NOTHING = frozenset[str]()


def team(robots: int, *overrides: str) -> Scenario:
    return load("straight", overrides, robots)


@pytest.mark.parametrize("robots", [4, 12])
def test_a_team_that_the_machine_carries_runs_as_written(robots: int) -> None:
    scenario = team(robots)
    assert fit_to(scenario, NOTHING, 2.0) == (scenario, "")


@pytest.mark.parametrize("robots", [16, 30])
def test_a_larger_team_runs_at_lower_rates_and_the_line_says_how_many_fit(robots: int) -> None:
    fit, text = fit_to(team(robots), NOTHING, 2.0)
    assert (fit.mission.control_hz, fit.mission.profile, fit.world.lidar.beams) == (SLOW_HZ, "auto", FEW_BEAMS)
    assert fit.mission.robots == team(robots).mission.robots
    assert "carries 12 robots at 50 Hz, 32 with control at 20 Hz" in text
    assert f"{robots} robots run so" in text


def test_what_the_command_line_sets_is_kept() -> None:
    kept = frozenset({"mission.control_hz", "mission.profile", "world.lidar.beams"})
    scenario = team(16)
    fit, text = fit_to(scenario, kept, 2.0)
    assert fit == scenario
    assert (
        text == "this machine (2 cores) carries 12 robots at 50 Hz: 16 robots will be late, and may lose their leader"
    )


def test_more_robots_than_the_machine_carries_at_any_rate_are_told_of() -> None:
    _, text = fit_to(team(60), NOTHING, 2.0)
    assert "32 with" in text
    assert "60 robots will be late" in text


@pytest.mark.parametrize("profile", ["wifi", "auto"])
def test_rates_that_are_low_already_stay_as_they_are(profile: str) -> None:
    scenario = team(30, "mission.control_hz=20", f"mission.profile={profile}", "world.lidar.beams=16")
    assert fit_to(scenario, NOTHING, 2.0) == (scenario, "")


def test_a_machine_of_one_core_is_told_of_in_the_singular() -> None:
    assert "this machine (1 core) carries 5 robots" in fit_to(team(16), NOTHING, 1.0)[1]


def test_the_rate_that_may_be_kept_is_the_scenarios_own() -> None:
    _, text = fit_to(team(16, "mission.control_hz=40"), NOTHING, 2.0)
    assert text.endswith("16 robots run so (--set mission.control_hz=40 keeps that rate)")


def test_no_rate_is_offered_to_be_kept_that_is_kept_already() -> None:
    _, text = fit_to(team(30), frozenset({"mission.control_hz"}), 4.0)
    assert text.endswith("32 with control at 50 Hz, profile auto and 90 lidar beams: 30 robots run so")


@pytest.mark.parametrize(("hz", "most"), [(50.0, 46), (20.0, 93)])
def test_cores_that_the_world_cannot_use_carry_no_more_robots(hz: float, most: int) -> None:
    assert [carried(Mission(control_hz=hz), cores) for cores in (8.0, 64.0)] == [most, most]


@pytest.mark.parametrize("on_cores", [0.1, 0.5])
def test_the_smallest_machine_carries_one_robot(on_cores: float) -> None:
    assert carried(Mission(), on_cores) >= 1


def test_this_machine_has_some_cores() -> None:
    assert cores() > 0.0
