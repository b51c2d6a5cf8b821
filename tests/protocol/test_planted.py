"""Planted bugs: each rule broken on purpose, and the directed test that must notice.

The bugs live here and nowhere else: a patch is applied for one call of one test. protocol/README.md holds the table
for readers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import protocol.holder
import protocol.lease
import protocol.membership
import protocol.quorum
from protocol.acceptor import Acceptor
from protocol.candidate import Candidate
from protocol.gateway import Gateway
from protocol.holder import Holder
from protocol.lease import Lease
from protocol.messages import Config, Fenced, Term
from protocol.timing import Timing
from tests.protocol import test_gateway, test_lease

Plant = Callable[[pytest.MonkeyPatch], None]


def _counted_from_the_grant(patch: pytest.MonkeyPatch) -> None:
    honest = Holder.granted

    def granted(self: Holder, src: Any, grant: Any, config: Config, now: float) -> bool:
        self._sent_at[grant.round] = now
        return honest(self, src, grant, config, now)

    patch.setattr(Holder, "granted", granted)


def _bond_as_short_as_the_lease(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Timing, "grant_s", property(lambda self: self.act_s))


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
    patch.setattr(Lease, "_at_rest_at", lambda self: float("-inf"))


def _released_term_granted_again(patch: pytest.MonkeyPatch) -> None:
    honest = Acceptor.release

    def release(self: Acceptor, term: Term) -> bool:
        freed = honest(self, term)
        self.released = Term()
        return freed

    patch.setattr(Acceptor, "release", release)


def _expired_leader_goes_on(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Lease, "_expire", lambda self, now, effects: None)


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

    patch.setattr(protocol.lease, "rewritten", rewritten)


def _full_house_of_a_majority(patch: pytest.MonkeyPatch) -> None:
    def full_house(self: Candidate, config: Config, universe: tuple[int, ...]) -> Any:
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


PLANTED: tuple[tuple[str, Plant, Callable[[], None]], ...] = (
    (
        "lease counted from the grant (bug 1)",
        _counted_from_the_grant,
        test_lease.test_e2_bug_1_a_renewal_counts_from_its_round_not_from_the_grants,
    ),
    (
        "no margin for clocks and motion (bug 2)",
        _bond_as_short_as_the_lease,
        lambda: test_gateway.test_e2_a_bond_outlives_lease_and_residual_motion_on_the_worst_clocks("std"),
    ),
    (
        "stamp age not checked (bug 4)",
        _gateway_without("old_stamp"),
        test_lease.test_bug_4_the_command_of_a_zombie_is_refused,
    ),
    (
        "lease end not noticed (bug 5)",
        _expired_leader_goes_on,
        test_lease.test_e7_bug_5_at_the_lease_end_it_stops_before_anything_else,
    ),
    (
        "leadership announced with the first grant (bug 6)",
        _announced_with_the_first_grant,
        test_lease.test_bug_6_leadership_is_announced_only_with_the_quorums_grants,
    ),
    (
        "amnesiac votes (bug 7)",
        _amnesiac_votes,
        test_lease.test_bug_7_an_amnesiac_does_not_bring_an_old_majority_back,
    ),
    (
        "terms begin again at a restart (bug 8)",
        _terms_begin_again_at_a_restart,
        test_lease.test_bug_8_terms_grow_over_a_total_blackout,
    ),
    (
        "voters change without a joint config (bug 9)",
        _voters_change_without_a_joint_config,
        lambda: test_lease.test_e17_a_team_shrinks_one_by_one_to_the_last_and_the_chain_is_the_old_one_minus_the_dead(
            (1, 2, 3)
        ),
    ),
    (
        "hint taken as proof (bug 13)",
        _hint_taken_as_proof,
        test_lease.test_e15_when_the_gateway_cannot_be_reached_the_bond_is_waited_out,
    ),
    (
        "released term granted again (bug 14)",
        _released_term_granted_again,
        test_lease.test_bug_14_a_late_propose_does_not_bring_a_released_lease_back,
    ),
    (
        "silence of four heartbeats (bug 15)",
        _silence_of_four_heartbeats,
        lambda: test_lease.test_l5_bug_15_loss_changes_neither_holder_nor_chain(0.2),
    ),
    (
        "bond ignored",
        _bond_ignored,
        test_lease.test_e3_a_bound_voter_refuses_another_holder_and_tells_when_it_is_free,
    ),
    (
        "RELEASE before the stop is confirmed",
        _release_before_the_stop_is_confirmed,
        test_lease.test_e4_the_release_waits_for_the_own_gateway,
    ),
    (
        "full house of a majority",
        _full_house_of_a_majority,
        test_lease.test_e18_a_fleet_that_nobody_remembers_waits_for_everybody,
    ),
    (
        "gateway without the term check",
        _gateway_without("old_term"),
        test_gateway.test_e12_a_lower_term_is_refused_and_counted,
    ),
    (
        "gateway open at its start",
        _gateway_without("shut"),
        test_gateway.test_e13_a_gateway_that_starts_is_shut_for_the_longest_bond,
    ),
    (
        "FENCED answered without fencing",
        _fence_without_effect,
        test_gateway.test_e11_a_fenced_gateway_brakes_and_refuses_what_is_below,
    ),
    (
        "chain forgets its order",
        _chain_forgets_its_order,
        lambda: test_lease.test_l6_after_a_silent_death_of_the_leader_the_next_in_the_chain_leads_within_its_bond(0),
    ),
)


@pytest.mark.parametrize(("name", "plant", "directed"), PLANTED, ids=[name for name, _, _ in PLANTED])
def test_a_planted_bug_is_seen(
    name: str, plant: Plant, directed: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    directed()
    with monkeypatch.context() as patch:
        plant(patch)
        with pytest.raises(AssertionError):
            directed()
