"""Schedules of the fleet stop alone: they keep I10 and I16, and find what breaks E28 to E31."""

from __future__ import annotations

from collections import Counter

import pytest
from msgspec import structs

from lfa.deploy.analysis.verification.fleet_stop import LatchKept
from lfa.deploy.client.stop_call import ANSWER_S
from lfa.deploy.fuzz.fleet_stop.stop_play import play_stops
from lfa.deploy.fuzz.fleet_stop.stop_schedules import FAULTS_UNTIL_S, KINDS, draw_stop_schedule
from lfa.deploy.fuzz.schedules import ScheduledFault
from lfa.deploy.fuzz.search.command import command
from lfa.deploy.fuzz.search.searches import Search, shrink
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import STILL
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import GatewayStamp, Member, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.stop import NEVER_STOPPED, NO_STOP, StopOrder
from tests.protocol.lease.planted import PLANTED, Bug

SEEDS = 150
OF_THE_STOP = tuple(bug for bug in PLANTED if bug.where in ("rule E28", "rule E29", "rule E30", "rule E31"))
AGENT = Member(1, 11)


@pytest.fixture(scope="module")
def played() -> tuple[Counter[str], int]:
    """Faults that took effect in some schedules, and the number of robots that stand by a stop in them."""
    kinds: Counter[str] = Counter()
    stood = 0
    for seed in range(SEEDS):
        result = play_stops(draw_stop_schedule(seed))
        assert result.violations == [], f"reproduce: lfa fuzz --stops --seed {seed} -v"
        kinds += result.counts
        stood += sum(len(outcome.done) for _, _, outcome in result.stops if outcome.complete)
    return kinds, stood


def test_schedules_of_the_fleet_stop_keep_its_invariants_and_draw_every_kind_of_fault(
    played: tuple[Counter[str], int],
) -> None:
    kinds, stood = played
    assert set(kinds) >= set(KINDS)
    assert stood > SEEDS, "most stops and resumes reach somebody"


def test_one_seed_is_one_run() -> None:
    one, other = (play_stops(draw_stop_schedule(7)) for _ in range(2))
    assert (one.counts, one.stops) == (other.counts, other.stops)


def test_schedules_have_teams_that_need_an_operator_and_robots_that_reboot_alone() -> None:
    drawn = [draw_stop_schedule(seed) for seed in range(SEEDS)]
    assert any(one.operator_timeout_s and any(call.kind == "watch" for call in one.stops) for one in drawn)
    for one in drawn:
        reboots = [(fault.at, fault.targets) for fault in one.faults if fault.kind == "reboot"]
        if any(fault.kind == "cut" and (fault.at, fault.targets) in reboots for fault in one.faults):
            return
    pytest.fail("no robot reboots while it is cut off")


@pytest.mark.parametrize("seed", range(40))
def test_after_the_last_fault_a_stop_reaches_every_robot_and_a_resume_lets_every_robot_go(seed: int) -> None:
    """Earlier calls are over by then: one that goes on would say its own word again."""
    schedule = draw_stop_schedule(seed)
    earlier = tuple(call for call in schedule.stops if call.at < FAULTS_UNTIL_S - ANSWER_S)
    last = (ScheduledFault(1.55, "stop", (1,)), ScheduledFault(1.9, "resume", (1,)))
    played = play_stops(structs.replace(schedule, stops=(*earlier, *last)))
    outcomes = [outcome for _, _, outcome in played.stops[-2:]]
    assert [(outcome.complete, len(outcome.done)) for outcome in outcomes] == [(True, schedule.robots)] * 2


@pytest.mark.parametrize("bug", OF_THE_STOP, ids=lambda bug: bug.what)
def test_every_planted_bug_of_the_fleet_stop_is_found_and_its_rule_named(
    bug: Bug, monkeypatch: pytest.MonkeyPatch
) -> None:
    bug.plant(monkeypatch)
    found = (play_stops(draw_stop_schedule(seed)) for seed in range(SEEDS))
    rules = {rule for one in found if one.broken for rule in one.broken.rules}
    assert bug.where.removeprefix("rule ") in rules


def test_what_is_found_is_shrunk_to_few_faults_and_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    next(bug for bug in OF_THE_STOP if "any resume" in bug.what).plant(monkeypatch)
    search = Search("stops")
    bad = next(one.schedule for _, one in search.played(range(SEEDS)) if one.violations)
    small = shrink(bad, "I16", search.player)
    assert len(small.faults) + len(small.stops) < len(bad.faults) + len(bad.stops)
    assert any(violation.name == "I16" for violation in play_stops(small).violations)


@pytest.mark.parametrize(("answers", "violations"), [((1,), 1), ((2,), 1), ((2, 3), 0)])
def test_i16_an_agent_that_says_to_be_certain_has_heard_more_than_half(
    answers: tuple[int, ...], violations: int
) -> None:
    """Of a team of five; its own gateway, which has just started, tells it nothing."""
    checker = LatchKept(timing_of("std"))
    checker.names(0.0, (1, 2, 3, 4, 5))
    checker.gateway_starts(0.0, 1, 0.3)
    for other in answers:
        checker.told_of_stop(0.1, AGENT, other)
    stamp = GatewayStamp(1, 0.4)
    command = CmdVel(Header("robot1", AGENT.incarnation, 1, 0.4), STILL, Term(1, 1, 11), 1, True, stamp, NEVER_STOPPED)
    checker.obeys(0.4, 1, command, 0.0)
    checker.turns(0.4, 1, NO_STOP)
    assert len(checker.violations) == violations


@pytest.mark.parametrize(("seq", "violations"), [(4, 1), (6, 0)])
def test_i16_a_replayed_order_lets_no_wheel_turn_without_an_operator(seq: int, violations: int) -> None:
    checker = LatchKept(timing_of("std"), operator_timeout_s=0.5)
    for at, number in ((1.0, 5), (2.0, seq)):
        order = StopOrder(Header("operator", 3, number, at), NO_STOP, (Member(1, 1),))
        checker.hears_order(at, 1, 1, order)
    checker.turns(2.1, 1, NO_STOP)
    assert len(checker.violations) == violations


@pytest.mark.parametrize("other", [{"whole": True}, {"is_guided": True}])
def test_schedules_of_the_fleet_stop_go_with_no_other_search(other: dict[str, bool]) -> None:
    with pytest.raises(Refused, match="--stops"):
        command(is_stops=True, **other)
