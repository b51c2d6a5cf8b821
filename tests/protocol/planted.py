"""Planted bugs: each rule broken on purpose, as a switch that exists in tests only, with the directed test that must
notice. `python -m tests.protocol.hunt` tells after how many schedules of `lfa fuzz` each is noticed as well.

The usual bugs are those of the design's section 8, the mutants those of its section 7, the wordings those that failed
at the end of its section 10.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pytest
from msgspec import structs

import protocol.holder
import protocol.lease
import protocol.membership
import protocol.quorum
import protocol.reshape
from deploy.run import schedules
from deploy.run.arena import Arena
from deploy.run.network import Clock
from protocol.acceptor import Acceptor
from protocol.candidate import Candidate
from protocol.effects import StepDown
from protocol.election import Election
from protocol.gateway import Gateway
from protocol.holder import Holder
from protocol.lease import Lease
from protocol.messages import Config, Fenced, Grantee, Member, Nack, Promise, Propose, Term
from protocol.peers import Peers
from protocol.stopping import Stopping
from protocol.timing import Timing
from tests.protocol import test_gateway, test_lease, test_usual_bugs

Plant = Callable[[pytest.MonkeyPatch], None]


def _counted_from_the_grant(patch: pytest.MonkeyPatch) -> None:
    honest = Holder.granted

    def granted(self: Holder, src: Any, grant: Any, config: Config, now: float) -> bool:
        self._sent_at[grant.round] = now
        return honest(self, src, grant, config, now)

    patch.setattr(Holder, "granted", granted)


def _bond_as_short_as_the_lease(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Timing, "grant_s", property(lambda self: self.act_s))


def _bond_of_half_the_lease(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Timing, "grant_s", property(lambda self: self.act_s / 2.0))


def _bond_ignored(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Acceptor, "bound", lambda self, now: None)


def _hint_taken_as_proof(patch: pytest.MonkeyPatch) -> None:
    honest = Lease.hint

    def hint(self: Lease, id: int, incarnation: int, up: bool, now: float) -> Any:
        effects = honest(self, id, incarnation, up, now)
        self._acceptor.bond = None
        return effects

    patch.setattr(Lease, "hint", hint)


def _release_before_the_stop_is_confirmed(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Stopping, "at_rest_at", float("-inf"))


def _released_term_granted_again(patch: pytest.MonkeyPatch) -> None:
    honest = Acceptor.release

    def release(self: Acceptor, term: Term) -> bool:
        freed = honest(self, term)
        self.released = Term()
        return freed

    patch.setattr(Acceptor, "release", release)


def _expired_leader_goes_on(patch: pytest.MonkeyPatch) -> None:
    """It leads and asks on, and its gateway alone still refuses."""
    patch.setattr(Lease, "may_command", lambda self, now: self._holder is not None)
    _deaf_leader_goes_on_asking(patch)


def _announced_with_the_first_grant(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(protocol.holder, "quorum_time", lambda config, times: max(times.values()))


def _silence_of_four_heartbeats(patch: pytest.MonkeyPatch) -> None:
    honest = Holder.silent
    patch.setattr(Holder, "silent", lambda self, member, now, s: honest(self, member, now, s / 4.0))


def _terms_begin_again_at_a_restart(patch: pytest.MonkeyPatch) -> None:
    honest = Lease.__init__
    patch.setattr(
        Lease, "__init__", lambda self, me, mission, timing, now, floor: honest(self, me, mission, timing, now, 0)
    )


def _amnesiac_votes(patch: pytest.MonkeyPatch) -> None:
    """Ids vote instead of lives, and a blank promise counts."""
    promised = Candidate.promised
    patch.setattr(Candidate, "promised", lambda self, src, needs, blank: promised(self, src, needs, False))

    def is_half(voters: Any, tie: Any, present: Any) -> bool:
        here = {m.id for m in present}
        count = sum(v.id in here for v in voters)
        return 2 * count > len(voters) or (2 * count == len(voters) and tie is not None and tie.id in here)

    patch.setattr(protocol.quorum, "is_half", is_half)


def _voters_change_without_a_joint_config(patch: pytest.MonkeyPatch) -> None:
    honest = protocol.membership.rewritten

    def rewritten(config: Config, *arguments: Any) -> Config:
        newer = honest(config, *arguments)
        return Config(newer.version, newer.voters, newer.tie, None, newer.chain)

    patch.setattr(protocol.reshape, "rewritten", rewritten)


def _full_house_of_a_majority(patch: pytest.MonkeyPatch) -> None:
    def full_house(self: Candidate, config: Config, universe: tuple[int, ...], *_: object) -> Any:
        lives = tuple(sorted(self._promised))
        return lives if 2 * len(lives) > len(universe) else ()

    patch.setattr(Candidate, "full_house", full_house)


def _gateway_without(reason: str) -> Plant:
    def plant(patch: pytest.MonkeyPatch) -> None:
        honest = Gateway._objection

        def objection(self: Gateway, cmd: Any, now: float) -> str | None:
            found = honest(self, cmd, now)
            return None if found == reason else found

        patch.setattr(Gateway, "_objection", objection)

    return plant


def _fence_without_effect(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Gateway, "fence", lambda self, fence, now: Fenced(fence.old, fence.term))


def _chain_forgets_its_order(patch: pytest.MonkeyPatch) -> None:
    honest = protocol.membership.led_by

    def led_by(*arguments: Any, **named: Any) -> Config:
        config = honest(*arguments, **named)
        head, *rest = config.chain
        return Config(config.version, config.voters, config.tie, config.previous, (head, *reversed(rest)))

    patch.setattr(protocol.lease, "led_by", led_by)


def _wall_clock_in_lease_arithmetic(patch: pytest.MonkeyPatch) -> None:
    honest = Arena.step_wall

    def step_wall(self: Arena, robot_id: int, by_s: float) -> None:
        honest(self, robot_id, by_s)
        process = self.processes[robot_id]
        process.clock = Clock(process.clock.offset + by_s, process.clock.rate)
        process.wakes_at = self.now
        self.at(self.now, self._wake, process)

    patch.setattr(Arena, "step_wall", step_wall)


def _lease_end_not_told(patch: pytest.MonkeyPatch) -> None:
    honest = Lease._expire

    def expire(self: Lease, now: float, effects: list[Any]) -> None:
        mine: list[Any] = []
        honest(self, now, mine)
        effects += [effect for effect in mine if not isinstance(effect, StepDown)]

    patch.setattr(Lease, "_expire", expire)


def _restart_votes_at_once(patch: pytest.MonkeyPatch) -> None:
    _amnesiac_votes(patch)
    honest = Acceptor.__init__

    def begin(self: Acceptor, floor: Term, grant_s: float, now: float) -> None:
        honest(self, floor, grant_s, now)
        self.silent_until = now

    patch.setattr(Acceptor, "__init__", begin)


def _refusal_raises_the_promise(patch: pytest.MonkeyPatch) -> None:
    honest = Acceptor.prepare

    def prepare(self: Acceptor, src: Any, body: Any, *arguments: Any) -> Any:
        answer = honest(self, src, body, *arguments)
        if isinstance(answer, Nack):
            self.promised = max(self.promised, body.term)
        return answer

    patch.setattr(Acceptor, "prepare", prepare)


def _new_term_with_every_asking(patch: pytest.MonkeyPatch) -> None:
    honest = Candidate.asked

    def asked(self: Candidate, now: float) -> None:
        honest(self, now)
        self.term = Term(self.term.n + 1, self.term.issuer, self.term.incarnation)

    patch.setattr(Candidate, "asked", asked)


def _deaf_leader_goes_on_asking(patch: pytest.MonkeyPatch) -> None:
    """It commands no more, but its PROPOSEs keep the voters bound."""
    honest = Lease.next_deadline

    def next_deadline(self: Lease) -> float:
        if self._holder is None:
            return honest(self)
        asking = self._holder.next_round_at if self._candidate is None else self._candidate.deadline
        return min(self._hello_at, self._stopping.release_at, asking)

    patch.setattr(Lease, "next_deadline", next_deadline)
    patch.setattr(Lease, "_expire", lambda self, now, effects: None)


def _equal_ranks(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Election, "rank", lambda self, config, robot_id, peers: 0)
    patch.setattr(Lease, "_stands_before", lambda self, src, body: False)


def _clocks_a_quarter_wrong(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(test_usual_bugs, "RATE_ERROR", 0.25)
    patch.setattr(schedules, "CLOCK_RATE_ERROR", 0.25)


def _hand_over_writes_a_config(patch: pytest.MonkeyPatch) -> None:
    honest = Lease._hand_over

    def hand_over(self: Lease, holder: Holder, now: float, effects: list[Any]) -> None:
        honest(self, holder, now, effects)
        gift = self._stopping.gift
        if gift is not None:
            written = protocol.membership.led_by(self.config, gift.holder, gift.term, lambda m: False, keep_leader=True)
            self._stopping.gift = Propose(gift.term, written, gift.round, gift.holder, nonce=gift.nonce)

    patch.setattr(Lease, "_hand_over", hand_over)


def _full_house_that_is_not_joint(patch: pytest.MonkeyPatch) -> None:
    honest = protocol.membership.of_full_house

    def of_full_house(*arguments: Any) -> Config:
        config = honest(*arguments)
        return Config(config.version, config.voters, config.tie, None, config.chain)

    patch.setattr(protocol.lease, "of_full_house", of_full_house)


def _promises_up_to_a_released_term(patch: pytest.MonkeyPatch) -> None:
    honest = Acceptor.release

    def release(self: Acceptor, term: Term) -> bool:
        promised = self.promised
        freed = honest(self, term)
        self.promised = promised
        return freed

    patch.setattr(Acceptor, "release", release)


def _replaced_lives_make_a_full_house(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Candidate, "_answering", lambda self, _superseded: {m.id: m for m in sorted(self._promised)})


def _one_try_a_heartbeat(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(protocol.holder, "RETRY_HEARTBEATS", 1.0)


def _given_up_restamp_is_released(patch: pytest.MonkeyPatch) -> None:
    def drop(self: Lease, now: float, effects: list[Any]) -> None:
        candidate, self._candidate = self._candidate, None
        if candidate is not None and candidate.holder is not None:
            self._acceptor.release(candidate.term)
            effects.append(protocol.lease.Send("all", protocol.lease.Release(candidate.term)))

    patch.setattr(Lease, "_drop_candidate", drop)


def _needs_fence_without_the_holder(patch: pytest.MonkeyPatch) -> None:
    """All that is known of the term to be fenced is who issued it."""
    honest = Acceptor.prepare

    def prepare(self: Acceptor, *arguments: Any) -> Any:
        answer = honest(self, *arguments)
        if isinstance(answer, Promise) and answer.needs_fence is not None:
            term = answer.needs_fence.term
            guess = Grantee(term, Member(term.issuer, term.incarnation))
            return Promise(answer.term, answer.config, guess, answer.blank)
        return answer

    patch.setattr(Acceptor, "prepare", prepare)


def _one_highest_fenced_term(patch: pytest.MonkeyPatch) -> None:
    honest = Acceptor.propose

    def propose(self: Acceptor, src: Any, body: Propose, config: Config, now: float) -> Any:
        bond = self.bound(now)
        if bond is not None and body.fenced and bond.term <= max(body.fenced):
            fenced = (*body.fenced, bond.term)
            body = Propose(body.term, body.config, body.round, body.holder, fenced, body.nonce)
        return honest(self, src, body, config, now)

    patch.setattr(Acceptor, "propose", propose)


def _acts_under_a_restamp_at_once(patch: pytest.MonkeyPatch) -> None:
    def term(self: Lease) -> Term:
        if self._holder is None:
            return self.config.version.term
        asked = self._candidate is not None and self._candidate.holder is not None
        return self._candidate.term if asked and self._candidate is not None else self._holder.term

    patch.setattr(Lease, "term", property(term))


def _rounds_that_restart(patch: pytest.MonkeyPatch) -> None:
    honest = Holder.given

    def given(self: Holder, number: int, since: float) -> None:
        honest(self, number, since)
        self._round = 0

    patch.setattr(Holder, "given", given)


def _stamp_read_after_the_check(patch: pytest.MonkeyPatch) -> None:
    """What a pause holds back gets a fresh stamp before it leaves."""
    honest = Arena.resume

    def resume(self: Arena, robot_id: int, shuffled: bool = False) -> None:
        process, stamp = self.processes[robot_id], self.stamp(robot_id)
        if process.paused and process.drawn is not None and stamp is not None:
            process.drawn = structs.replace(process.drawn, gateway=stamp)
        honest(self, robot_id, shuffled)

    patch.setattr(Arena, "resume", resume)


def _forget_as_a_standing_flag(patch: pytest.MonkeyPatch) -> None:
    honest = Lease.request_forget

    def request_forget(self: Lease, lost: tuple[Member, ...], now: float) -> Any:
        effects = honest(self, lost, now)
        self._election.forget_until = float("inf")
        return effects

    patch.setattr(Lease, "request_forget", request_forget)


def _ended_lives_may_still_grant(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Peers, "has_ended", lambda self, member: False)


class Bug(NamedTuple):
    where: str
    """In the design: a usual bug by its number, a mutant, a wording; else a rule of ours."""
    what: str
    plant: Plant
    caught_by: str
    """The directed test, by the name of its module and its own."""
    case: tuple[Any, ...] = ()
    """What it is called with."""

    def directed(self) -> None:
        """Run the directed test. Raises AssertionError when it notices something."""
        module, _, name = self.caught_by.partition("::")
        getattr({"gateway": test_gateway, "lease": test_lease, "usual_bugs": test_usual_bugs}[module], name)(*self.case)


# fmt: off
PLANTED: tuple[Bug, ...] = (
    Bug("bug 1", "lease counted from the grant, not from the asking", _counted_from_the_grant,
        "lease::test_e2_bug_1_a_renewal_counts_from_its_round_not_from_the_grants"),
    Bug("bug 2", "no margin: a bond as short as the lease", _bond_as_short_as_the_lease,
        "gateway::test_e2_a_bond_outlives_lease_and_residual_motion_on_the_worst_clocks", ("std",)),
    Bug("bug 3", "the wall clock in lease arithmetic", _wall_clock_in_lease_arithmetic,
        "usual_bugs::test_bug_3_a_stepped_wall_clock_changes_nothing"),
    Bug("bug 4", "check, pause, act: the age of stamps is not checked", _gateway_without("old_stamp"),
        "lease::test_bug_4_the_command_of_a_zombie_is_refused"),
    Bug("bug 5", "the end of a lease is not told", _lease_end_not_told,
        "usual_bugs::test_bug_5_the_end_of_a_lease_is_told"),
    Bug("bug 5", "the end of a lease is not noticed", _expired_leader_goes_on,
        "lease::test_e7_bug_5_at_the_lease_end_it_stops_before_anything_else"),
    Bug("bug 6", "leadership announced with the first grant", _announced_with_the_first_grant,
        "lease::test_bug_6_leadership_is_announced_only_with_the_quorums_grants"),
    Bug("bug 7", "an amnesiac votes after its silence", _amnesiac_votes,
        "lease::test_bug_7_an_amnesiac_does_not_bring_an_old_majority_back"),
    Bug("bug 8", "terms begin again at a restart", _terms_begin_again_at_a_restart,
        "lease::test_bug_8_terms_grow_over_a_total_blackout"),
    Bug("bug 9", "voters change without a joint config", _voters_change_without_a_joint_config,
        "lease::test_e17_a_team_shrinks_one_by_one_to_the_last_and_the_chain_is_the_old_one_minus_the_dead",
        ((1, 2, 3),)),
    Bug("bug 10", "a refused candidate raises the promise", _refusal_raises_the_promise,
        "usual_bugs::test_a_refused_candidate_raises_no_promise_at_a_voter_without_a_bond_either"),
    Bug("bug 10", "a new term with every asking", _new_term_with_every_asking,
        "usual_bugs::test_bug_10_a_candidate_that_nobody_hears_keeps_its_term"),
    Bug("bug 11", "a deaf leader goes on asking", _deaf_leader_goes_on_asking,
        "usual_bugs::test_bug_11_a_leader_that_is_heard_and_hears_nothing_falls_silent"),
    Bug("bug 12", "equal ranks: everybody stands at once", _equal_ranks,
        "usual_bugs::test_bug_12_many_that_stand_at_once_do_not_go_on_beating_each_other"),
    Bug("bug 13", "a hint taken as proof", _hint_taken_as_proof,
        "lease::test_e15_when_the_gateway_cannot_be_reached_the_bond_is_waited_out"),
    Bug("bug 14", "a released term is granted again", _released_term_granted_again,
        "lease::test_bug_14_a_late_propose_does_not_bring_a_released_lease_back"),
    Bug("bug 15", "out of the chain after four silent heartbeats", _silence_of_four_heartbeats,
        "lease::test_l5_bug_15_loss_changes_neither_holder_nor_chain", (0.2,)),
    Bug("mutant", "a bond of half the lease", _bond_of_half_the_lease,
        "gateway::test_e2_a_bond_outlives_lease_and_residual_motion_on_the_worst_clocks", ("std",)),
    Bug("mutant", "PREPARE and PROPOSE ignore a live grant", _bond_ignored,
        "lease::test_e3_a_bound_voter_refuses_another_holder_and_tells_when_it_is_free"),
    Bug("mutant", "a restarted process votes at once", _restart_votes_at_once,
        "lease::test_e1_a_process_that_starts_promises_nothing_for_the_longest_bond"),
    Bug("mutant", "clocks 25 % wrong against an eps of 0.1 %", _clocks_a_quarter_wrong,
        "usual_bugs::test_e2_leases_are_exclusive_on_the_worst_clocks"),
    Bug("wording", "a hand-over writes a new config without phase 1", _hand_over_writes_a_config,
        "usual_bugs::test_e16_a_hand_over_leaves_the_config_as_it_is_version_included"),
    Bug("wording", "a full house that is not joint with all of it", _full_house_that_is_not_joint,
        "usual_bugs::test_e18_a_config_of_a_full_house_is_joint_with_all_of_it"),
    Bug("wording", "RELEASE before the gateway's confirmation", _release_before_the_stop_is_confirmed,
        "lease::test_e4_the_release_waits_for_the_own_gateway"),
    Bug("wording", "RELEASE of a raised term that is given up", _given_up_restamp_is_released,
        "usual_bugs::test_e4_a_raised_term_that_is_given_up_releases_nothing"),
    Bug("wording", "needs_fence without the holder", _needs_fence_without_the_holder,
        "usual_bugs::test_e15_of_a_term_that_was_handed_over_the_holders_gateway_is_fenced_not_the_issuers"),
    Bug("wording", "one highest fenced term instead of a set", _one_highest_fenced_term,
        "usual_bugs::test_e3_a_fence_of_a_later_term_frees_nobody_bound_to_an_earlier_one"),
    Bug("wording", "acting under a raised term before its quorum", _acts_under_a_restamp_at_once,
        "usual_bugs::test_e10_until_a_quorum_has_granted_the_raised_term_it_acts_under_the_old_one"),
    Bug("wording", "rounds that restart", _rounds_that_restart,
        "usual_bugs::test_rounds_of_a_term_go_on_where_its_issuer_stopped"),
    Bug("wording", "the stamp is read after the lease check", _stamp_read_after_the_check,
        "lease::test_bug_4_the_command_of_a_zombie_is_refused"),
    Bug("wording", "`forget` as a standing flag", _forget_as_a_standing_flag,
        "lease::test_e20_the_word_holds_for_one_attempt"),
    Bug("rule E18", "a full house of a majority", _full_house_of_a_majority,
        "lease::test_e18_a_fleet_that_nobody_remembers_waits_for_everybody"),
    Bug("rule E12", "a gateway without the term check", _gateway_without("old_term"),
        "gateway::test_e12_a_lower_term_is_refused_and_counted"),
    Bug("rule E13", "a gateway that is open at its start", _gateway_without("shut"),
        "gateway::test_e13_a_gateway_that_starts_is_shut_for_the_longest_bond"),
    Bug("rule E11", "FENCED answered without fencing", _fence_without_effect,
        "gateway::test_e11_a_fenced_gateway_brakes_and_refuses_what_is_below"),
    Bug("rule E6", "a candidate waits for grants of lives that have ended", _ended_lives_may_still_grant,
        "usual_bugs::test_e6_an_attempt_that_only_ended_lives_could_still_grant_is_given_up_at_once"),
    Bug("rule E4", "a voter promises up to a released term", _promises_up_to_a_released_term,
        "lease::test_e4_a_voter_promises_nothing_up_to_a_released_term_and_says_what_beats_it"),
    Bug("rule E18", "a replaced life makes a full house", _replaced_lives_make_a_full_house,
        "lease::test_e18_a_life_that_promised_and_was_replaced_makes_no_full_house"),
    Bug("rule E2", "one try a heartbeat", _one_try_a_heartbeat,
        "lease::test_l5_a_pair_without_witness_keeps_its_leader_at_a_fifth_of_all_messages_lost"),
    Bug("rule E8", "the chain forgets its order", _chain_forgets_its_order,
        "lease::test_l6_after_a_silent_death_of_the_leader_the_next_in_the_chain_leads_within_its_bond", (0,)),
)
# fmt: on
