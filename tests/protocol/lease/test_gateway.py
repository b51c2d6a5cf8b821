"""The gateway of one robot: E11 to E14, and usual bugs 4 and 8 of the design's list at the actuator."""

from math import inf, nan

import pytest

from lfa.protocol.geometry import STILL, Twist
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.term_window import BURST, FREE, FRESH, LAST
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import NO_TERM, Fence, GatewayStamp, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.stop import NEVER_STOPPED
from lfa.protocol.mission import Limits

STD = timing_of("std")
GO = Twist(0.5, 0.1)
OPEN = STD.grant_s + 0.001


def opened(robot_id: int = 1) -> Gateway:
    """A gateway of incarnation 9 that started at 0 and is open at `OPEN`."""
    gateway = Gateway(robot_id, 9, STD, 0.0)
    gateway.agent_up(5, 0.0)
    return gateway


def command(
    at: float,
    n: int = 3,
    *,
    holder: int = 1,
    as_leader: bool = True,
    life: int = 5,
    gateway: int = 9,
    issuer: int = 1,
    seq: int = 0,
    twist: Twist = GO,
    grant_s: float = STD.grant_s,
) -> CmdVel:
    header, term, stamp = Header("robot1", life, seq, 0.0), Term(n, issuer, 1), GatewayStamp(gateway, at)
    return CmdVel(header, twist, term, holder, as_leader, stamp, NEVER_STOPPED, grant_s)


def test_e25_commands_of_a_team_with_other_durations_are_refused() -> None:
    """With a longer D it would obey a former leader beyond its lease; with a shorter T_grant, forget a fence."""
    gateway = opened()
    for profile in ("fast", "wifi"):
        other = command(1.0, grant_s=timing_of(profile).grant_s)  # type: ignore[arg-type]
        assert gateway.command(other, 1.0) == "other_timing"
    assert gateway.twist(1.0) == STILL
    assert gateway.command(command(1.0), 1.0) is None


def test_e12_a_fresh_command_of_the_newest_term_moves_the_robot() -> None:
    gateway = opened()
    assert gateway.command(command(OPEN), OPEN + 0.01) is None
    assert gateway.twist(OPEN + 0.01) == GO
    assert gateway.term_max == Term(3, 1, 1)


def test_e12_a_lower_term_is_refused_and_counted() -> None:
    gateway = opened()
    gateway.command(command(OPEN, n=4), OPEN)
    assert gateway.command(command(OPEN, n=3), OPEN) == "old_term"
    assert gateway.refused == {"old_term": 1}


def test_e12_a_zombies_command_carries_an_old_moment_and_is_refused() -> None:
    gateway = opened()
    drawn = command(OPEN)
    assert gateway.command(drawn, OPEN + STD.deadman_s + 0.001) == "old_stamp"


@pytest.mark.parametrize("ahead_s", [1e-6, 0.1, 1e9])
def test_e12_a_time_that_the_gateway_has_not_reached_is_refused_and_the_deadman_fires(ahead_s: float) -> None:
    gateway = opened()
    assert gateway.command(command(OPEN + ahead_s), OPEN) == "future_stamp"
    assert gateway.twist(OPEN) == STILL
    assert gateway.command(command(OPEN, seq=1), OPEN) is None, "later commands are obeyed"
    assert gateway.twist(OPEN + STD.deadman_s + 0.001) == STILL


def test_e12_of_commands_that_echo_one_time_the_newest_counts() -> None:
    gateway, back = opened(), Twist(-0.1, 0.0)
    assert gateway.command(command(OPEN, seq=7, twist=back), OPEN) is None
    assert gateway.command(command(OPEN, seq=6), OPEN) == "reordered"
    assert gateway.twist(OPEN) == back
    assert gateway.command(command(OPEN, seq=8), OPEN) is None


@pytest.mark.parametrize("bad", [Twist(nan, 0.0), Twist(0.0, inf), Twist(-inf, nan)])
def test_e12_a_twist_that_is_no_number_is_refused(bad: Twist) -> None:
    gateway = opened()
    assert gateway.command(command(OPEN, twist=bad), OPEN) == "bad_twist"
    assert gateway.twist(OPEN) == STILL


@pytest.mark.parametrize(
    ("wanted", "passed"),
    [(Twist(9.0, -9.0), Twist(1.0, -2.0)), (Twist(-1.0, 0.5), Twist(-0.3, 0.5)), (Twist(0.4, 0.1), Twist(0.4, 0.1))],
)
def test_e12_a_gateway_passes_on_no_more_than_its_drive_can_do(wanted: Twist, passed: Twist) -> None:
    gateway = Gateway(1, 9, STD, 0.0, Limits())
    assert gateway.command(command(OPEN, twist=wanted), OPEN) is None
    assert gateway.twist(OPEN) == passed


def test_e12_a_moment_of_an_earlier_life_of_the_gateway_is_refused() -> None:
    assert opened().command(command(OPEN, gateway=8), OPEN) == "foreign_stamp"


def test_e12_a_leader_commands_its_own_robot_only() -> None:
    assert opened().command(command(OPEN, holder=2), OPEN) == "foreign_holder"


def test_i3_one_term_has_one_holder_at_a_gateway() -> None:
    gateway = opened()
    assert gateway.command(command(OPEN, holder=2, as_leader=False), OPEN) is None
    assert gateway.command(command(OPEN, holder=1), OPEN) == "two_holders"


def test_e12_without_a_command_the_robot_brakes_after_the_deadman() -> None:
    gateway = opened()
    gateway.command(command(OPEN), OPEN)
    assert gateway.twist(OPEN + STD.deadman_s) == GO
    assert gateway.twist(OPEN + STD.deadman_s + 0.001) == STILL


def test_e11_a_fenced_gateway_brakes_and_refuses_what_is_below() -> None:
    gateway = opened()
    gateway.command(command(OPEN), OPEN)
    answer = gateway.fence(Fence(Term(3, 1, 1), Term(4, 2, 1)), OPEN)
    assert (answer.old, answer.term) == (Term(3, 1, 1), Term(4, 2, 1))
    assert gateway.twist(OPEN) == STILL
    assert gateway.command(command(OPEN), OPEN) == "old_term"


def test_e11_a_late_fence_of_a_lower_term_changes_nothing() -> None:
    gateway = opened()
    gateway.command(command(OPEN, n=5), OPEN)
    gateway.fence(Fence(Term(2, 2, 1), Term(4, 2, 1)), OPEN)
    assert gateway.twist(OPEN) == GO
    assert gateway.term_max == Term(5, 1, 1)


def test_e13_a_gateway_that_starts_is_shut_for_the_longest_bond() -> None:
    gateway = Gateway(1, 9, STD, 0.0)
    assert gateway.command(command(STD.grant_s - 0.001), STD.grant_s - 0.001) == "shut"
    assert gateway.command(command(OPEN), OPEN) is None


def test_e26_the_term_of_an_obeyed_command_is_known_and_a_fence_a_little_above_it_is_believed() -> None:
    """A gateway that knows no term believes less of others than that."""
    for commanded in (True, False):
        gateway, term = opened(), FREE + FRESH + 100
        if commanded:
            assert gateway.command(command(OPEN, n=term), OPEN) is None
        above = Term(term + BURST, 2, 1)
        assert gateway.fence(Fence(Term(term, 1, 1), above), OPEN).term == (above if commanded else NO_TERM)


def test_e26_no_command_makes_a_gateway_refuse_all_terms_that_a_team_comes_to() -> None:
    gateway = opened()
    assert gateway.command(command(OPEN, n=LAST), OPEN) == "far_term"
    assert gateway.command(command(OPEN, seq=1), OPEN) is None
    assert gateway.term_max.n == 3


def test_e14_the_death_of_the_agent_bars_its_term_but_not_the_next() -> None:
    gateway = opened()
    gateway.command(command(OPEN), OPEN)
    gateway.agent_down(5, OPEN)
    assert gateway.latched
    assert gateway.twist(OPEN) == STILL
    assert gateway.command(command(OPEN), OPEN) == "latched"
    assert gateway.command(command(OPEN, n=4), OPEN) is None
    assert not gateway.latched


def test_e14_a_latch_does_not_bar_following() -> None:
    gateway = opened()
    gateway.agent_down(5, OPEN)
    assert gateway.command(command(OPEN, as_leader=False, holder=2, issuer=2), OPEN) is None


def test_only_the_newest_life_of_an_agent_is_obeyed() -> None:
    gateway = opened()
    gateway.agent_up(6, OPEN)
    assert gateway.command(command(OPEN, life=5), OPEN) == "old_incarnation"
    assert gateway.command(command(OPEN, life=6), OPEN) is None


def test_the_robot_brakes_for_a_later_life_of_its_agent_and_for_no_other() -> None:
    for life, twist in ((4, GO), (5, GO), (6, STILL)):
        gateway = opened()
        gateway.command(command(OPEN), OPEN)
        gateway.agent_up(life, OPEN)
        assert gateway.twist(OPEN) == twist
        assert gateway.agent == max(life, 5)


def test_the_death_of_an_earlier_life_does_not_latch_a_later_one() -> None:
    gateway = opened()
    gateway.command(command(OPEN, life=6), OPEN)
    gateway.agent_down(5, OPEN)
    assert not gateway.latched


@pytest.mark.parametrize("profile", ["fast", "std", "wifi", "auto"])
def test_e2_a_bond_outlives_lease_and_residual_motion_on_the_worst_clocks(profile: str) -> None:
    timing = timing_of(profile)  # type: ignore[arg-type]
    assert timing.grant_s / 1.001 >= (timing.act_s + timing.deadman_s) / 0.999
    assert timing.deadman_s >= 0.06
    assert timing.act_s >= 5 * timing.heartbeat_s
