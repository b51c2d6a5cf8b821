"""A robot that its machine keeps late steps less often before its lease is lost, says so, and steps as before later."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from lfa.agents.load.control_rate import CALM_S, LATE_SHARE, ControlRate
from lfa.agents.navigator import Navigator
from lfa.agents.team_state import ROW_S_MAX, TeamState, table_s
from lfa.deploy.fuzz.agent_simulation import AgentSimulation
from lfa.deploy.fuzz.schedules import FAIR, Schedule
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.lease.timing import timing_for
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Event, Level, PoseStamped, Status, TableRow
from lfa.protocol.mission import CONTROL_HZ_MIN, Following, Mission, Profile
from lfa.protocol.runtime.lateness import LATE_SECONDS

STEP_S = 0.001
LAG_S, AGES_S = 0.12, 0.25
"""Lateness [s] with which a robot steps less often, and with which its commands grow too old as well."""


def rate_of(mission: Mission) -> tuple[ControlRate, float]:
    """Return the rate of a robot with that mission, and a lateness [s] that is too much."""
    deadman_s = timing_for(mission).deadman_s
    return ControlRate(mission, deadman_s), 1.1 * LATE_SHARE * deadman_s


def slowest_hz(mission: Mission) -> float:
    rate, late_s = rate_of(mission)
    for second in range(20 * LATE_SECONDS):
        rate.update(late_s, float(second))
    return rate.control_hz


def late_for(rate: ControlRate, late_s: float, seconds: int, since: float = 0.0) -> list[float]:
    """Return the rates [Hz] after each of so many late seconds."""
    rates = []
    for second in range(seconds):
        rate.update(late_s, since + second)
        rates.append(rate.control_hz)
    return rates


AUTO = Mission(profile="auto")


def test_three_late_seconds_in_a_row_halve_the_rate_and_three_more_halve_it_again() -> None:
    rate, late_s = rate_of(AUTO)
    assert late_for(rate, late_s, 7) == [50.0, 50.0, 25.0, 25.0, 25.0, 12.5, 12.5]


def test_single_pauses_of_the_machine_change_no_rate() -> None:
    rate, late_s = rate_of(AUTO)
    for second in range(60):
        assert not rate.update(late_s if second % LATE_SECONDS else 0.0, float(second))


def test_a_calm_time_doubles_the_rate_again_and_not_sooner() -> None:
    rate, late_s = rate_of(AUTO)
    late_for(rate, late_s, LATE_SECONDS)
    last_late = LATE_SECONDS - 1.0
    assert not rate.update(0.0, last_late + 0.9 * CALM_S)
    assert rate.update(0.0, last_late + CALM_S)
    assert (rate.control_hz, rate.table_s, rate.text()) == (50.0, table_s(4), "")


def test_a_rate_that_was_too_high_again_is_waited_for_twice_as_long() -> None:
    rate, late_s = rate_of(AUTO)
    late_for(rate, late_s, LATE_SECONDS)
    rate.update(0.0, 50.0)
    late_for(rate, late_s, LATE_SECONDS, 51.0)
    last_late = 51.0 + LATE_SECONDS - 1.0
    assert not rate.update(0.0, last_late + 1.9 * CALM_S)
    assert rate.update(0.0, last_late + 2.0 * CALM_S)


@pytest.mark.parametrize(
    ("profile", "control_hz", "least_hz"),
    [("auto", 50.0, 12.5), ("wifi", 50.0, 12.5), ("auto", 20.0, 10.0), ("auto", 10.0, 10.0), ("std", 50.0, 50.0)],
)
def test_two_commands_come_within_the_deadman_and_ten_in_a_second(
    profile: Profile, control_hz: float, least_hz: float
) -> None:
    mission = Mission(profile=profile, control_hz=control_hz)
    assert slowest_hz(mission) == least_hz
    assert least_hz >= CONTROL_HZ_MIN
    if least_hz < control_hz:
        assert 1.0 / least_hz + 2.0 * mission.control_period_s <= timing_for(mission).deadman_s + 1e-9


def test_gains_that_need_a_higher_rate_keep_it() -> None:
    assert slowest_hz(Mission(profile="auto", following=Following(gains={"lambda_psi_per_s": 20.0}))) == 25.0


@pytest.mark.parametrize("robots", [4, 16, 60, 200])
def test_a_row_that_is_lost_leaves_the_place_in_the_one_before_it_known(robots: int) -> None:
    rate, late_s = rate_of(Mission(tuple(range(1, robots + 1))))
    late_for(rate, late_s, 20)
    assert rate.table_s >= table_s(robots)
    assert rate.table_s == table_s(robots) or 2.0 * rate.table_s <= ROW_S_MAX


def test_the_text_has_the_rates() -> None:
    rate, late_s = rate_of(AUTO)
    assert rate.text() == ""
    late_for(rate, late_s, 2 * LATE_SECONDS)
    assert rate.text() == "kept late by its machine: control at 12.5 Hz, table at 0.67 Hz"


def test_a_late_robot_whose_mission_is_changed_ramps_up_by_its_own_period_until_it_keeps_time() -> None:
    mission = Mission(profile="auto")
    navigator = Navigator(1, mission, TeamState())
    navigator.pace(12.5)
    assert navigator.leading.lead.period_s == 0.08
    navigator.change(replace(mission, leading=replace(mission.leading, cruise_mps=0.3)), 1, 1.0)
    assert navigator.leading.lead.period_s == 0.08
    navigator.pace(mission.control_hz)
    assert navigator.leading.lead.period_s == mission.control_period_s


def test_a_late_robot_brakes_before_a_team_mate_by_its_own_period() -> None:
    mission, team = Mission(profile="auto"), TeamState()
    team.hear_row(4, TableRow(Header("robot4", 1, 1, 0.0), 0.7, 0.0, 0.0, 0.0, 0.0, Role.FOLLOWER), 0.0)
    slow, late, usual = (Navigator(1, replace(mission, control_hz=hz), team) for hz in (12.5, 50.0, 50.0))
    late.pace(12.5)
    least, braked, fastest = (
        navigator.limits.slow(Twist(0.8, 0.0), Role.LEADER, Pose2D(), 0.0, by_law=False).linear_x
        for navigator in (slow, late, usual)
    )
    assert braked == least < fastest


class LateTeam:
    """Three robots, in virtual time, of which the second is kept late from 3 s to 13 s; what they said."""

    def __init__(self, lag_s: float = LAG_S) -> None:
        self._lag_s = lag_s
        self.team = AgentSimulation(Schedule(1, 3, True, "auto", False, {}, (), FAIR, revive_all=True)).start_all()
        self.said: list[tuple[float, Message]] = []
        self.team.simulator.taps.append(lambda at, _key, _payload, message: self.said.append((at, message)))
        self.team.run(3.0)
        self._keep_late(13.0)

    def _keep_late(self, until: float) -> None:
        team = self.team
        if team.now < until:
            team.pause(2)
            team.at(team.now + self._lag_s, team.resume, 2)
            team.at(team.now + self._lag_s + STEP_S, self._keep_late, until)

    def warnings_of(self, robot: int) -> str:
        """Return all that the robot's status has warned of."""
        own = (m for _, m in self.said if isinstance(m, Status) and m.header.sender == f"robot{robot}")
        return "; ".join(status.text for status in own if status.level is Level.WARN)

    def poses_of(self, robot: int, since: float, until: float) -> int:
        return sum(
            isinstance(message, PoseStamped) and message.header.sender == f"robot{robot}" and since <= at < until
            for at, message in self.said
        )


def test_a_late_robot_steps_less_often_says_so_and_steps_as_before_when_it_keeps_time() -> None:
    late = LateTeam()
    late.team.run(30.0)
    assert "control at 12.5 Hz" in late.warnings_of(2)
    rates = [m.data["control_hz"] for _, m in late.said if isinstance(m, Event) and m.kind == "rate"]
    assert rates == [25.0, 12.5, 25.0]
    assert late.poses_of(2, 14.0, 18.0) == pytest.approx(4 * 12.5, abs=2)
    assert late.poses_of(1, 14.0, 18.0) == pytest.approx(4 * 50.0, abs=2)


def test_no_leader_changes_while_a_robot_steps_less_often() -> None:
    late = LateTeam()
    late.team.run(30.0)
    assert [robot for _, robot, _ in late.team.log] == [1]


def test_whose_lag_it_is_stands_in_the_status_of_the_late_robot_and_of_no_other() -> None:
    late = LateTeam(AGES_S)
    late.team.run(15.0)
    assert "late: by up to 249 ms, the machine is too busy" in late.warnings_of(2)
    assert not [robot for robot in (1, 3) if "late" in late.warnings_of(robot)]
