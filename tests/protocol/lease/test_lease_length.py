"""The profile `auto`: how long a lease its holder asks for, and what was granted is never shortened (E36)."""

from __future__ import annotations

from functools import partial

import pytest
from msgspec import structs

from lfa.deploy.fuzz.fault_injector import play
from lfa.deploy.fuzz.search.lagging import draw_lagging
from lfa.protocol.lease.acceptor import Acceptor
from lfa.protocol.lease.holder import CALM_S, RENEWALS_PER_LEASE, Holder, LeaseLength
from lfa.protocol.lease.timing import Timing, lengths_of, timing_of
from lfa.protocol.messages.consensus import Config, Grant, Member, Propose, Role, Term, Version
from lfa.protocol.mission import Profile
from tests.protocol.lease import plants_of_time
from tests.protocol.lease.test_roster import Operated
from tests.rigs.lease_scenes import OLD, STD, A, B, Team, config_of

AUTO = timing_of("auto")
SHORT, MIDDLE, LONG = lengths_of(AUTO)
ME, OTHER = Member(1, 1), Member(2, 1)
TERM = Term(5, 1, 1)
CONFIG = Config(Version(TERM), (ME, OTHER), None, None, (ME, OTHER))
QUICK_S, LAG_S = 0.005, 0.15
SETTLED_S = 25.0
"""Time [s] after which a team that keeps time asks for its shortest lease."""
CUT_SHORT = 477
"""Seed of `lfa fuzz --lagging` in which a leader is lost just after it has asked for a shorter lease."""


def renew(holder: Holder, now: float, took_s: float = QUICK_S) -> Propose:
    """Send a round at `now` [s], and grant it by both voters `took_s` later."""
    propose = holder.next_propose(CONFIG, now)
    for voter in CONFIG.voters:
        holder.granted(voter, Grant(TERM, propose.round, CONFIG.version, now), CONFIG, now + took_s)
    return propose


def settled() -> tuple[Holder, float]:
    """Return a holder that asks for its shortest lease, and the time [s] at which its next round is due."""
    holder = Holder(ME, TERM, AUTO, 10.0, agreed=1)
    while holder.timing is not SHORT or holder.expiry is None or holder.expiry > holder.next_round_at + SHORT.act_s:
        renew(holder, holder.next_round_at)
    return holder, holder.next_round_at


def propose(holder: Member, grant_ms: int, number: int = 0, term: Term = TERM) -> Propose:
    return Propose(term, config_of(term), number, holder, grant_ms=grant_ms)


def bound_until(voter: Acceptor) -> float:
    assert voter.bond is not None
    return voter.bond.expiry


@pytest.mark.parametrize("profile", ["fast", "std", "wifi"])
def test_e36_in_the_other_profiles_every_round_asks_for_the_whole_bond(profile: Profile) -> None:
    holder = Holder(ME, TERM, timing_of(profile), 10.0, agreed=1)
    asked = {renew(holder, 10.0 + 0.02 * n).grant_ms for n in range(round(3.0 * CALM_S / 0.02))}
    assert (asked, holder.timing) == ({0}, timing_of(profile))


@pytest.mark.parametrize("length", [SHORT, MIDDLE, LONG], ids=lambda length: f"{length.act_s:g} s")
def test_e36_each_length_survives_lost_rounds_and_its_bond_outlives_it(length: Timing) -> None:
    assert length.act_s >= 5.0 * length.heartbeat_s
    assert length.grant_s / 1.001 >= (length.act_s + AUTO.deadman_s) / 0.999
    assert length.act_s < length.chain_silence_s < length.remove_silence_s > length.grant_s


@pytest.mark.parametrize("length", [SHORT, MIDDLE], ids=lambda length: f"{length.act_s:g} s")
def test_e36_silences_of_a_shorter_lease_are_as_many_leases_as_those_of_the_longest(length: Timing) -> None:
    silences = (length.chain_silence_s / length.act_s, length.remove_silence_s / length.act_s)
    assert silences == pytest.approx((LONG.chain_silence_s / LONG.act_s, LONG.remove_silence_s / LONG.act_s))


def test_e36_a_new_holder_asks_for_the_longest_lease() -> None:
    holder = Holder(ME, TERM, AUTO, 10.0, agreed=1)
    assert (renew(holder, 10.0).grant_ms, holder.expiry) == (0, 10.0 + AUTO.act_s)


def test_e36_after_each_calm_time_it_asks_for_the_next_shorter_lease() -> None:
    holder, asked = Holder(ME, TERM, AUTO, 10.0, agreed=1), dict[float, float]()
    while holder.next_round_at < 10.0 + 3.0 * CALM_S:
        at = holder.next_round_at
        renew(holder, at)
        asked.setdefault(holder.timing.act_s, at)
    assert list(asked) == [LONG.act_s, MIDDLE.act_s, SHORT.act_s]
    shorter = (asked[MIDDLE.act_s], asked[SHORT.act_s])
    assert shorter == pytest.approx((10.0 + CALM_S, 10.0 + 2.0 * CALM_S), abs=0.2)


def test_e36_with_the_first_renewal_that_takes_a_third_of_it_a_longer_lease_is_asked_for() -> None:
    holder, at = settled()
    renew(holder, at, 0.99 * SHORT.act_s / RENEWALS_PER_LEASE)
    assert holder.timing is SHORT
    renew(holder, holder.next_round_at, 1.01 * SHORT.act_s / RENEWALS_PER_LEASE)
    assert holder.next_propose(CONFIG, holder.next_round_at).grant_ms == round(1000.0 * MIDDLE.grant_s)


def test_e36_a_round_that_is_sent_late_asks_for_a_longer_lease_itself() -> None:
    holder, due_at = settled()
    assert holder.next_propose(CONFIG, due_at + 0.9 * SHORT.act_s).grant_ms == 0


def test_e36_rounds_without_an_answer_ask_for_a_longer_lease_before_the_present_one_ends() -> None:
    holder, at = settled()
    assert holder.expiry is not None
    asked = holder.next_propose(CONFIG, at)
    while asked.grant_ms == round(1000.0 * SHORT.grant_s):
        at = holder.next_round_at
        asked = holder.next_propose(CONFIG, at)
    assert at < holder.expiry


def test_e36_each_growth_doubles_the_calm_time() -> None:
    length, at = LeaseLength(AUTO, 0.0), 0.0
    calms: list[float] = []
    for _ in range(3):
        since = at
        while length.timing is LONG:
            at += 0.5
            length.fit(0.0, at)
        calms.append(at - since)
        length.fit(LONG.act_s / RENEWALS_PER_LEASE, at)
    assert calms == [CALM_S, 2.0 * CALM_S, 4.0 * CALM_S]


def test_e36_a_renewal_that_needs_the_present_lease_begins_the_calm_time_anew() -> None:
    length = LeaseLength(AUTO, 0.0)
    length.fit(LONG.act_s / RENEWALS_PER_LEASE, 0.9 * CALM_S)
    length.fit(0.0, 1.8 * CALM_S)
    assert length.timing is LONG
    length.fit(0.0, 1.9 * CALM_S)
    assert length.timing is MIDDLE


def test_e36_a_renewal_that_takes_longer_than_any_lease_bears_asks_for_the_longest() -> None:
    length = LeaseLength(AUTO, 0.0)
    length.fit(0.0, CALM_S)
    length.fit(0.0, 2.0 * CALM_S)
    assert length.timing is SHORT
    length.fit(2.0 * LONG.act_s, 2.0 * CALM_S)
    assert length.timing is LONG


def test_e36_a_lease_grows_only_when_a_quorum_has_granted_the_longer_one() -> None:
    holder, at = settled()
    short = holder.next_propose(CONFIG, at)
    late = at + 0.9 * SHORT.act_s
    longer = holder.next_propose(CONFIG, late)
    for voter in CONFIG.voters:
        holder.granted(voter, Grant(TERM, short.round, CONFIG.version, 0.0), CONFIG, late)
    assert holder.expiry == at + SHORT.act_s
    for voter in CONFIG.voters:
        holder.granted(voter, Grant(TERM, longer.round, CONFIG.version, 0.0), CONFIG, late)
    assert holder.expiry == late + LONG.act_s


def test_e36_a_shorter_round_ends_no_lease_early() -> None:
    holder = Holder(ME, TERM, AUTO, 10.0, agreed=1)
    while holder.timing is LONG:
        before = holder.expiry
        renew(holder, holder.next_round_at)
    assert before is not None and before <= (holder.expiry or 0.0)


def test_e36_while_a_lease_shrinks_a_round_binds_its_voters_until_an_earlier_one_ends_and_no_longer() -> None:
    holder, sent_at = Holder(ME, TERM, AUTO, 10.0, agreed=1), [10.0]
    while holder.timing is LONG:
        sent_at.append(holder.next_round_at)
        asked = renew(holder, sent_at[-1])
    assert sent_at[-1] + asked.grant_ms / 1000.0 == pytest.approx(sent_at[-2] + AUTO.grant_s, abs=0.01)


def test_e36_a_voter_is_bound_for_as_long_as_it_was_told() -> None:
    voter = Acceptor(Term(), AUTO.grant_s, 0.0)
    voter.propose(A, propose(A, 602), OLD, 10.0)
    assert bound_until(voter) == pytest.approx(10.602)


def test_e36_a_shorter_round_shortens_no_bond() -> None:
    voter = Acceptor(Term(), AUTO.grant_s, 0.0)
    voter.propose(A, propose(A, 0), OLD, 10.0)
    voter.propose(A, propose(A, 602, 1), OLD, 10.1)
    assert bound_until(voter) == pytest.approx(10.0 + AUTO.grant_s)


def test_e36_nobody_is_bound_for_longer_than_a_gateway_waits() -> None:
    voter = Acceptor(Term(), STD.grant_s, 0.0)
    voter.propose(A, propose(A, 60_000), OLD, 10.0)
    assert bound_until(voter) == pytest.approx(10.0 + STD.grant_s)


def test_e36_a_bond_to_another_holder_begins_anew() -> None:
    voter, later = Acceptor(Term(), AUTO.grant_s, 0.0), Term(6, 2, 8)
    voter.propose(A, propose(A, 0), OLD, 10.0)
    freed = Propose(later, config_of(later), 0, B, fenced=(TERM,), grant_ms=602)
    voter.propose(B, freed, OLD, 10.1)
    assert bound_until(voter) == pytest.approx(10.702)


def lag(team: Team, until: float) -> None:
    """Let every process step only each 150 ms, until `until` [s]."""

    def step(robot_id: int) -> None:
        team.resume(robot_id)
        if team.now < until:
            team.at(team.now + 0.001, team.pause, robot_id)
            team.at(team.now + LAG_S, step, robot_id)

    for robot_id in team.ids:
        team.at(team.now + team.random.uniform(0.0, LAG_S), step, robot_id)


@pytest.mark.parametrize(("profile", "keeps"), [("auto", True), ("std", False)])
@pytest.mark.parametrize("seed", range(3))
def test_e36_a_team_that_lags_by_150_ms_keeps_its_leader_and_loses_it_with_fixed_durations(
    profile: Profile, keeps: bool, seed: int
) -> None:
    team = Team(profile=profile, seed=seed, led_by=SETTLED_S)
    lag(team, SETTLED_S + 20.0)
    team.run(SETTLED_S + 21.0)
    assert (team.changes(SETTLED_S) == []) == keeps
    assert team.safe()


def test_e36_robots_without_a_vote_stay_in_the_chain_of_a_short_lease_at_a_fifth_of_all_messages_lost() -> None:
    team = Team(9, profile="auto", led_by=SETTLED_S)
    leader = team.processes[1].lease
    before, team.link_model.radio = leader.config, structs.replace(team.link_model.radio, loss=0.2)
    team.run(SETTLED_S + 20.0)
    assert len(before.voters) < len(before.chain)
    assert (leader.role, leader.config) == (Role.LEADER, before)


def test_l6_while_it_keeps_time_a_silent_leader_is_replaced_within_the_bond_of_its_short_lease() -> None:
    team = Team(profile="auto", led_by=SETTLED_S)
    team.at(SETTLED_S, partial(team.kill, hinted=False), 1)
    team.run(SETTLED_S + 2.0)
    assert team.led_at(SETTLED_S) - SETTLED_S < SHORT.grant_s + 4.0 * AUTO.rank_step_s
    assert team.safe()


def retired_while_the_lease_shrinks() -> Operated:
    """Return a team whose voters are others 0.3 s after its leader has begun to ask for less, cut off from these."""
    team = Operated(12, profile="auto", led_by=10.0)
    asks = team.lease_of(1)._memory.holder
    while asks is not None and asks.timing is LONG:
        team.run(team.now + 0.005)
    since = team.now
    for n, robot in enumerate((3, 4, 5, 6)):
        team.run(since + 0.05 * n)
        team.retire(robot)
    team.run(since + 0.3)
    old, new = (0, 1, 2), range(3, 13)
    team.part({pair for a in old for b in new for pair in ((a, b), (b, a))})
    return team


def test_e36_voters_that_are_added_while_a_lease_shrinks_are_bound_until_it_ends() -> None:
    """Of seven voters four have granted none of the longer rounds: alone they would be a quorum after a shorter one."""
    team = retired_while_the_lease_shrinks()
    assert team.lease_of(1).config.previous is None
    assert team.voters() == {0, 1, 2, 7, 8, 9, 10}
    team.run(team.now + 2.0)
    assert team.leaders() == [7]
    assert team.safe()


def test_e36_lagging_schedules_find_a_bond_that_is_shortened(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not play(draw_lagging(CUT_SHORT)).violations
    plants_of_time.round_that_asks_for_less(monkeypatch)
    plants_of_time.shorter_round_shortens_the_bond(monkeypatch)
    assert {violation.name for violation in play(draw_lagging(CUT_SHORT)).violations} & {"I1", "I4"}


def test_e36_a_report_of_a_bond_that_was_shortened_names_the_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    plants_of_time.round_that_asks_for_less(monkeypatch)
    plants_of_time.shorter_round_shortens_the_bond(monkeypatch)
    broken = play(draw_lagging(CUT_SHORT)).broken
    assert broken is not None
    assert broken.rules == ("E36", "E3")
    assert "term 3 asked for a shorter bond" in " ".join(step.text for step in broken.steps)
