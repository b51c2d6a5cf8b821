"""E27: a leader says who is there and not in its chain, and why; whoever lacks messages says so."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from lfa.agents.attendance import LACKING_SHARE, OUTSIDE_S, UNHEARD, Attendance
from lfa.agents.team_state import ROW_S_MAX, TeamState, report_s_max, table_s
from lfa.deploy.fuzz.agent_simulation import AgentSimulation
from lfa.deploy.fuzz.schedules import FAIR, Schedule
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import TableRow


@pytest.fixture
def team() -> AgentSimulation:
    """Three robots and a witness; robot 1 leads, robot 3 has ended."""
    made = AgentSimulation(Schedule(1, 3, True, "std", False, {}, (), FAIR, revive_all=True)).start_all().run(2.0)
    made.kill(3)
    made.run(3.0)
    assert made.leaders() == [1] and made.lease_of(1).chain == (1, 2)
    return made


def _update(team: AgentSimulation, at_s: tuple[float, ...], rows: Callable[[TeamState, float], None]) -> Attendance:
    """Return the leader's attendance after updates that many seconds from now, `rows` heard before each."""
    attendance, state = Attendance(1, (1, 2, 3)), TeamState()
    begin = team.processes[1].clock.local(team.now)
    for later_s in at_s:
        rows(state, begin + later_s)
        attendance.update(team.lease_of(1), state, begin + later_s)
    return attendance


def _rows(*robots: int) -> Callable[[TeamState, float], None]:
    def hear(state: TeamState, now: float) -> None:
        for robot in robots:
            header = Header(f"robot{robot}", 9, round(1000.0 * now), now)
            state.hear_row(robot, TableRow(header, 0.0, 0.0, 0.0, 0.0, 0.0, Role.FOLLOWER), now)

    return hear


def test_a_robot_that_has_ended_is_not_missed(team: AgentSimulation) -> None:
    attendance = _update(team, (0.0, OUTSIDE_S, 10.0), _rows(2))
    assert (attendance.outside, attendance.lacks_messages) == ({}, False)


def test_e27_a_leader_that_hears_rows_and_no_hello_lacks_messages(team: AgentSimulation) -> None:
    attendance = _update(team, (0.0, OUTSIDE_S), _rows(2, 3))
    assert (attendance.outside, attendance.lacks_messages) == ({3: UNHEARD}, True)
    assert attendance.text() == "robot3 not in the chain: no HELLO is heard of it"


def test_e27_a_leader_that_sees_a_token_and_hears_no_hello_lacks_messages(team: AgentSimulation) -> None:
    team.hint(3, 1, up=True)
    team.run(team.now + 0.1)
    assert _update(team, (0.0, OUTSIDE_S), _rows(2)).outside == {3: UNHEARD}


def test_e27_a_robot_that_hears_no_row_of_its_chain_lacks_messages(team: AgentSimulation) -> None:
    assert not _update(team, (0.0, 1.0), _rows(2)).lacks_messages
    attendance, state = Attendance(2, (1, 2, 3)), TeamState()
    now = team.processes[2].clock.local(team.now)
    _rows(1)(state, now)
    attendance.update(team.lease_of(2), state, now)
    assert not attendance.lacks_messages
    attendance.update(team.lease_of(2), state, now + LACKING_SHARE * state.report_s_max + 0.1)
    assert attendance.lacks_messages


@pytest.mark.parametrize("robots", [16, 96, 200, 1000])
def test_e27_no_robot_of_a_large_team_lacks_messages_between_two_rows(team: AgentSimulation, robots: int) -> None:
    attendance, state = Attendance(2, (1, 2, 3)), TeamState(report_s_max=report_s_max(robots))
    now = team.processes[2].clock.local(team.now)
    _rows(1)(state, now)
    attendance.update(team.lease_of(2), state, now + table_s(robots) + 1.0)
    assert not attendance.lacks_messages


@pytest.mark.parametrize("robots", [16, 200, 1000])
def test_what_a_row_says_counts_until_the_next_one_is_due_and_its_place_for_three_seconds(robots: int) -> None:
    state = TeamState(report_s_max=report_s_max(robots))
    _rows(2)(state, 10.0)
    due_at = 10.0 + table_s(robots)
    assert state.can_lead(2, due_at + 1.0)
    assert state.pose_of(2, 10.0 + 1.1 * ROW_S_MAX) is None
