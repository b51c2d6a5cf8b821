"""Planted bugs: each rule broken on purpose, as a switch that exists in tests only, with the directed test that must
notice. `python -m tests.protocol.lease.hunt` tells after how many schedules of `lfa fuzz` each is noticed as well.

The usual bugs are those of the design's section 8, the mutants those of its section 7, the wordings those that failed
at the end of its section 10.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, NamedTuple

from tests.protocol.lease import plants_of_orders as orders
from tests.protocol.lease import plants_of_rosters as rosters
from tests.protocol.lease import plants_of_stops as stops
from tests.protocol.lease import plants_of_team as team
from tests.protocol.lease import plants_of_time as time
from tests.protocol.lease.plants_of_time import Plant


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
        getattr(import_module(f"tests.protocol.lease.test_{module}"), name)(*self.case)


# fmt: off
PLANTED: tuple[Bug, ...] = (
    Bug("bug 1", "lease counted from the grant, not from the asking", time.counted_from_the_grant,
        "lease::test_e2_bug_1_a_renewal_counts_from_its_round_not_from_the_grants"),
    Bug("bug 2", "no margin: a bond as short as the lease", time.bond_as_short_as_the_lease,
        "gateway::test_e2_a_bond_outlives_lease_and_residual_motion_on_the_worst_clocks", ("std",)),
    Bug("bug 3", "the wall clock in lease arithmetic", time.wall_clock_in_lease_arithmetic,
        "usual_bugs::test_bug_3_a_stepped_wall_clock_changes_nothing"),
    Bug("bug 4", "check, pause, act: the age of stamps is not checked", time.gateway_without("old_stamp"),
        "lease::test_bug_4_the_command_of_a_zombie_is_refused"),
    Bug("rule E12", "a time that is still to come is believed", time.gateway_without("future_stamp"),
        "gateway::test_e12_a_time_that_the_gateway_has_not_reached_is_refused_and_the_deadman_fires", (1e9,)),
    Bug("bug 5", "the end of a lease is not told", time.lease_end_not_told,
        "usual_bugs::test_bug_5_the_end_of_a_lease_is_told"),
    Bug("bug 5", "the end of a lease is not noticed", time.expired_leader_goes_on,
        "lease::test_e7_bug_5_at_the_lease_end_it_stops_before_anything_else"),
    Bug("bug 6", "leadership announced with the first grant", team.announced_with_the_first_grant,
        "lease::test_bug_6_leadership_is_announced_only_with_the_quorums_grants"),
    Bug("bug 7", "an amnesiac votes after its silence", team.amnesiac_votes,
        "membership::test_bug_7_an_amnesiac_does_not_bring_an_old_majority_back"),
    Bug("bug 8", "terms begin again at a restart", time.terms_begin_again_at_a_restart,
        "election::test_bug_8_terms_grow_over_a_total_blackout"),
    Bug("bug 9", "voters change without a joint config", team.voters_change_without_a_joint_config,
        "membership::test_e17_a_team_shrinks_one_by_one_to_the_last_and_the_chain_is_the_old_one_minus_the_dead",
        ((1, 2, 3),)),
    Bug("bug 10", "a refused candidate raises the promise", time.refusal_raises_the_promise,
        "usual_bugs::test_a_refused_candidate_raises_no_promise_at_a_voter_without_a_bond_either"),
    Bug("bug 10", "a new term with every asking", team.new_term_with_every_asking,
        "usual_bugs::test_bug_10_a_candidate_that_nobody_hears_keeps_its_term"),
    Bug("bug 11", "a deaf leader goes on asking", time.deaf_leader_goes_on_asking,
        "usual_bugs::test_bug_11_a_leader_that_is_heard_and_hears_nothing_falls_silent"),
    Bug("bug 12", "equal ranks: everybody stands at once", team.equal_ranks,
        "usual_bugs::test_bug_12_many_that_stand_at_once_do_not_go_on_beating_each_other"),
    Bug("bug 13", "a hint taken as proof", team.hint_taken_as_proof,
        "fence_and_hand_over::test_e15_when_the_gateway_cannot_be_reached_the_bond_is_waited_out"),
    Bug("bug 14", "a released term is granted again", time.released_term_granted_again,
        "voter::test_bug_14_a_late_propose_does_not_bring_a_released_lease_back"),
    Bug("bug 15", "out of the chain after four silent heartbeats", time.silence_of_four_heartbeats,
        "lease::test_l5_bug_15_loss_changes_neither_holder_nor_chain", (0.2,)),
    Bug("mutant", "a bond of half the lease", time.bond_of_half_the_lease,
        "gateway::test_e2_a_bond_outlives_lease_and_residual_motion_on_the_worst_clocks", ("std",)),
    Bug("mutant", "PREPARE and PROPOSE ignore a live grant", time.bond_ignored,
        "voter::test_e3_a_bound_voter_refuses_another_holder_and_tells_when_it_is_free"),
    Bug("mutant", "a restarted process votes at once", team.restart_votes_at_once,
        "voter::test_e1_a_process_that_starts_promises_nothing_for_the_longest_bond"),
    Bug("mutant", "clocks 25 % wrong against an eps of 0.1 %", time.clocks_a_quarter_wrong,
        "usual_bugs::test_e2_leases_are_exclusive_on_the_worst_clocks"),
    Bug("wording", "a hand-over writes a new config without phase 1", team.hand_over_writes_a_config,
        "usual_bugs::test_e16_a_hand_over_leaves_the_config_as_it_is_version_included"),
    Bug("wording", "a full house that is not joint with all of it", team.full_house_that_is_not_joint,
        "usual_bugs::test_e18_a_config_of_a_full_house_is_joint_with_all_of_it"),
    Bug("wording", "RELEASE before the gateway's confirmation", time.release_before_the_stop_is_confirmed,
        "lease::test_e4_the_release_waits_for_the_own_gateway"),
    Bug("wording", "RELEASE of a raised term that is given up", team.given_up_restamp_is_released,
        "usual_bugs::test_e4_a_raised_term_that_is_given_up_releases_nothing"),
    Bug("wording", "needs_fence without the holder", time.needs_fence_without_the_holder,
        "usual_bugs::test_e15_of_a_term_that_was_handed_over_the_holders_gateway_is_fenced_not_the_issuers"),
    Bug("wording", "one highest fenced term instead of a set", time.one_highest_fenced_term,
        "usual_bugs::test_e3_a_fence_of_a_later_term_frees_nobody_bound_to_an_earlier_one"),
    Bug("wording", "acting under a raised term before its quorum", team.acts_under_a_restamp_at_once,
        "usual_bugs::test_e10_until_a_quorum_has_granted_the_raised_term_it_acts_under_the_old_one"),
    Bug("wording", "rounds that restart", time.rounds_that_restart,
        "usual_bugs::test_rounds_of_a_term_go_on_where_its_issuer_stopped"),
    Bug("wording", "the stamp is read after the lease check", time.stamp_read_after_the_check,
        "lease::test_bug_4_the_command_of_a_zombie_is_refused"),
    Bug("wording", "`forget` as a standing flag", team.forget_as_a_standing_flag,
        "forget::test_e20_the_word_holds_for_one_attempt"),
    Bug("rule E18", "a full house of a majority", team.full_house_of_a_majority,
        "election::test_e18_a_fleet_that_nobody_remembers_waits_for_everybody"),
    Bug("rule E12", "a gateway without the term check", time.gateway_without("old_term"),
        "gateway::test_e12_a_lower_term_is_refused_and_counted"),
    Bug("rule E13", "a gateway that is open at its start", time.gateway_without("shut"),
        "gateway::test_e13_a_gateway_that_starts_is_shut_for_the_longest_bond"),
    Bug("rule E11", "FENCED answered without fencing", time.fence_without_effect,
        "gateway::test_e11_a_fenced_gateway_brakes_and_refuses_what_is_below"),
    Bug("rule E6", "a candidate waits for grants of lives that have ended", team.ended_lives_may_still_grant,
        "usual_bugs::test_e6_an_attempt_that_only_ended_lives_could_still_grant_is_given_up_at_once"),
    Bug("rule E4", "a voter promises up to a released term", time.promises_up_to_a_released_term,
        "voter::test_e4_a_voter_promises_nothing_up_to_a_released_term_and_says_what_beats_it"),
    Bug("rule E18", "a replaced life makes a full house", team.replaced_lives_make_a_full_house,
        "election::test_e18_a_life_that_promised_and_was_replaced_makes_no_full_house"),
    Bug("rule E2", "one try a heartbeat", time.one_try_a_heartbeat,
        "lease::test_l5_a_pair_without_witness_keeps_its_leader_at_a_fifth_of_all_messages_lost"),
    Bug("rule E25", "nothing is agreed: whoever has another profile or mission votes", team.nothing_is_agreed,
        "agreement::test_e25_a_mixed_team_has_one_leader_through_a_cut"),
    Bug("rule E26", "any term is believed, also the last one", team.any_term_is_believed,
        "term_window::test_e26_a_made_up_term_stops_no_team", (2**53,)),
    Bug("rule E8", "the chain forgets its order", team.chain_forgets_its_order,
        "election::test_l6_after_a_silent_death_of_the_leader_the_next_in_the_chain_leads_within_its_bond", (0,)),
    Bug("rule E9", "a robot in place without a vote says HELLO to all", team.hello_goes_to_all,
        "membership::test_e9_a_robot_in_place_without_a_vote_says_hello_to_its_leader_alone_and_stays_in_the_chain"),
    Bug("rule E23", "an earlier incarnation is dropped in silence", team.earlier_incarnation_not_told,
        "incarnations::test_e23_a_robot_that_returns_with_another_clock_joins_at_the_tail", (-60.0,)),
    Bug("rule E23", "the highest number is the latest", team.highest_number_is_the_latest,
        "incarnations::test_e23_a_stray_token_locks_nobody_out", (2**53 - 1, 3)),
    Bug("rule E24", "a follower keeps its gateway's term to itself", team.gateway_term_kept_back,
        "incarnations::test_e24_a_follower_whose_gateway_saw_a_higher_term_makes_its_leader_raise_its_own", (2,)),
    Bug("rule E27", "declared again after events only", time.declared_again_after_events_only,
        "lost_declarations::test_e27_l2_a_host_that_comes_back_joins_though_routers_lost_its_declarations", (4,)),
    Bug("rule E28", "a stop is not held", stops.stop_is_not_held,
        "stop_latch::test_e28_a_stop_holds_until_a_later_resume"),
    Bug("rule E29", "late and replayed words of a stop are believed", stops.replayed_words_are_believed,
        "stop_latch::test_e29_late_and_replayed_words_are_void"),
    Bug("rule E30", "a gateway that starts may go", stops.gateway_that_starts_may_go,
        "stop_latch::test_e30_a_gateway_that_starts_stands_until_its_agent_tells_it_what_holds"),
    Bug("rule E30", "an agent that starts knows what holds", stops.agent_that_starts_knows_all,
        "stop_memory::test_e30_its_own_gateway_makes_it_certain"),
    Bug("rule E30", "any resume lets a gateway go that has just started", stops.any_resume_lets_a_started_gateway_go,
        "stop_latch::test_e30_a_replayed_resume_lets_no_gateway_go_that_has_just_started"),
    Bug("rule E30", "an agent lifts a stop", stops.agent_lifts_a_stop,
        "stop_latch::test_e30_an_agent_may_stop_its_gateway_and_lifts_no_stop"),
    Bug("rule E31", "a replayed order shows that an operator is there", stops.replayed_order_is_a_sign_of_life,
        "stop_latch::test_e31_a_replayed_order_is_no_sign_of_an_operator"),
    Bug("rule E32", "a late order is carried out", orders.late_orders_are_carried_out,
        "team_orders::test_e32_late_and_replayed_orders_are_refused"),
    Bug("rule E32", "the order of an old leader is obeyed", orders.orders_of_an_old_term_are_obeyed,
        "team_orders::test_e32_an_order_of_an_old_term_or_of_none_is_not_obeyed"),
    Bug("rule E32", "two orders of one version count as one", orders.orders_of_one_version_are_one,
        "team_orders::test_e32_of_two_orders_that_count_from_the_same_one_that_of_the_later_leader_holds_at_all"),
    Bug("rule E32", "nobody tells a new leader of an order that it missed", orders.nobody_tells_a_new_leader,
        "team_orders::test_e32_a_leader_that_says_no_order_is_told_of_it_once_it_had_time_to"),
    Bug("rule E32", "a new leader forgets what an operator has asked for", orders.new_leader_forgets_proposals,
        "team_orders::test_e32_a_new_leader_goes_on_with_the_newest_order_whoever_it_came_from"),
    Bug("rule E33", "spares vote like others", rosters.spares_vote_like_others,
        "roster::test_e33_spares_are_fewer_than_the_other_voters_also_when_these_are_lost"),
    Bug("rule E33", "whoever says HELLO is taken in", rosters.strangers_are_taken_in,
        "roster::test_e33_a_spare_that_nobody_admitted_is_in_no_chain_and_stands_for_no_election"),
    Bug("rule E33", "a full house leaves out the spare that asks for it",
        rosters.spares_stand_for_a_full_house_without_them,
        "roster::test_e33_a_spare_that_remembers_alone_makes_a_full_house_with_itself"),
    Bug("rule E34", "a retired robot stands for election", rosters.retired_robots_stand,
        "roster::test_e34_a_retired_robot_never_leads_also_when_nobody_else_is_left"),
    Bug("rule E34", "a candidate that has retired goes on", rosters.retired_candidates_go_on,
        "roster::test_e34_a_candidate_gives_up_too_when_a_late_propose_tells_it_of_its_retirement"),
    Bug("rule E34", "a retired robot is taken in again", rosters.retired_robots_are_taken_in_again,
        "roster::test_e34_the_chain_closes_over_a_retired_robot_and_it_neither_votes_nor_returns"),
    Bug("rule E35", "messages of any version are read", team.any_version_is_read,
        "wire_versions::test_e35_a_version_further_off_is_refused_with_the_own_one", (2**53,)),
    Bug("rule E36", "a shorter round shortens the bond", time.shorter_round_shortens_the_bond,
        "lease_length::test_e36_a_shorter_round_shortens_no_bond"),
    Bug("rule E36", "a lease as long as is asked for now", time.lease_as_long_as_is_asked_for_now,
        "lease_length::test_e36_a_lease_grows_only_when_a_quorum_has_granted_the_longer_one"),
    Bug("rule E36", "a round asks for less than an earlier one", time.round_that_asks_for_less,
        "lease_length::test_e36_voters_that_are_added_while_a_lease_shrinks_are_bound_until_it_ends"),
)
# fmt: on
