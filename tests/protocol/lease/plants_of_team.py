"""How the rules of elections, of hand-over and of membership are broken on purpose, each by a patch."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec import structs

import lfa.protocol.lease.failure_detector
import lfa.protocol.lease.holder
import lfa.protocol.lease.machine.candidacy
import lfa.protocol.lease.machine.lease
import lfa.protocol.lease.machine.memory
import lfa.protocol.lease.machine.resigning
import lfa.protocol.lease.machine.voting
import lfa.protocol.lease.membership
import lfa.protocol.lease.quorum
import lfa.protocol.lease.reconfiguration
from lfa.protocol.lease.acceptor import Acceptor
from lfa.protocol.lease.candidate import Candidate
from lfa.protocol.lease.election import Election
from lfa.protocol.lease.failure_detector import FailureDetector
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.machine.memory import LeaseMemory
from lfa.protocol.lease.term_window import TermWindow
from lfa.protocol.messages.consensus import Config, Member, Propose, Release, Term


def hint_taken_as_proof(patch: pytest.MonkeyPatch) -> None:
    honest = Lease.hint

    def hint(self: Lease, id: int, incarnation: int, up: bool, now: float) -> Any:
        effects = honest(self, id, incarnation, up, now)
        self._memory.acceptor.bond = None
        return effects

    patch.setattr(Lease, "hint", hint)


def announced_with_the_first_grant(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(lfa.protocol.lease.holder, "quorum_time", lambda config, times: max(times.values()))


def amnesiac_votes(patch: pytest.MonkeyPatch) -> None:
    """Ids vote instead of lives, and a blank promise counts."""
    promised = Candidate.promised
    patch.setattr(Candidate, "promised", lambda self, src, needs, blank: promised(self, src, needs, False))

    def is_half(voters: Any, tie: Any, present: Any) -> bool:
        here = {m.id for m in present}
        count = sum(v.id in here for v in voters)
        return 2 * count > len(voters) or (2 * count == len(voters) and tie is not None and tie.id in here)

    patch.setattr(lfa.protocol.lease.quorum, "is_half", is_half)


def voters_change_without_a_joint_config(patch: pytest.MonkeyPatch) -> None:
    honest = lfa.protocol.lease.membership.rewritten

    def rewritten(config: Config, *arguments: Any) -> Config:
        newer = honest(config, *arguments)
        return Config(newer.version, newer.voters, newer.tie, None, newer.chain)

    patch.setattr(lfa.protocol.lease.reconfiguration, "rewritten", rewritten)


def full_house_of_a_majority(patch: pytest.MonkeyPatch) -> None:
    def full_house(self: Candidate, config: Config, member_ids: tuple[int, ...], *_: object) -> Any:
        lives = tuple(sorted(self._promised))
        return lives if 2 * len(lives) > len(member_ids) else ()

    patch.setattr(Candidate, "full_house", full_house)


def chain_forgets_its_order(patch: pytest.MonkeyPatch) -> None:
    honest = lfa.protocol.lease.membership.led_by

    def led_by(*arguments: Any, **named: Any) -> Config:
        config = honest(*arguments, **named)
        head, *rest = config.chain
        return structs.replace(config, chain=(head, *reversed(rest)))

    patch.setattr(lfa.protocol.lease.machine.candidacy, "led_by", led_by)


def restart_votes_at_once(patch: pytest.MonkeyPatch) -> None:
    amnesiac_votes(patch)
    honest = Acceptor.__init__

    def begin(self: Acceptor, floor: Term, grant_s: float, now: float) -> None:
        honest(self, floor, grant_s, now)
        self.silent_until = now

    patch.setattr(Acceptor, "__init__", begin)


def new_term_with_every_asking(patch: pytest.MonkeyPatch) -> None:
    honest = Candidate.asked

    def asked(self: Candidate, now: float) -> None:
        honest(self, now)
        self.term = Term(self.term.n + 1, self.term.issuer, self.term.incarnation)

    patch.setattr(Candidate, "asked", asked)


def equal_ranks(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Election, "rank", lambda self, config, robot_id, peers: 0)
    patch.setattr(lfa.protocol.lease.machine.voting, "stands_before", lambda m, src, body: False)


def hand_over_writes_a_config(patch: pytest.MonkeyPatch) -> None:
    honest = lfa.protocol.lease.machine.resigning.transfer

    def transfer(m: LeaseMemory, now: float) -> Propose | None:
        proposal = honest(m, now)
        if proposal is None:
            return None
        written = lfa.protocol.lease.membership.led_by(
            m.config, proposal.holder, proposal.term, lambda m: False, keep_leader=True
        )
        return Propose(proposal.term, written, proposal.round, proposal.holder, nonce=proposal.nonce, agreed=m.agreed)

    patch.setattr(lfa.protocol.lease.machine.resigning, "transfer", transfer)


def full_house_that_is_not_joint(patch: pytest.MonkeyPatch) -> None:
    honest = lfa.protocol.lease.membership.unanimous_config

    def of_full_house(*arguments: Any) -> Config:
        config = honest(*arguments)
        return Config(config.version, config.voters, config.tie, None, config.chain)

    patch.setattr(lfa.protocol.lease.machine.candidacy, "unanimous_config", of_full_house)


def replaced_lives_make_a_full_house(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Candidate, "_answering", lambda self, _superseded: {m.id: m for m in sorted(self._promised)})


def given_up_restamp_is_released(patch: pytest.MonkeyPatch) -> None:
    def drop(m: LeaseMemory, now: float) -> None:
        candidate, m.candidate = m.candidate, None
        if candidate is not None and candidate.holder is not None:
            m.acceptor.release(candidate.term)
            m.send("all", Release(candidate.term))

    patch.setattr(lfa.protocol.lease.machine.resigning, "drop_candidacy", drop)


def acts_under_a_restamp_at_once(patch: pytest.MonkeyPatch) -> None:
    def term(self: Lease) -> Term:
        m = self._memory
        if m.holder is None:
            return m.config.version.term
        asked = m.candidate is not None and m.candidate.holder is not None
        return m.candidate.term if asked and m.candidate is not None else m.holder.term

    patch.setattr(Lease, "term", property(term))


def forget_as_a_standing_flag(patch: pytest.MonkeyPatch) -> None:
    honest = Lease.request_forget

    def request_forget(self: Lease, lost: tuple[Member, ...], now: float) -> Any:
        effects = honest(self, lost, now)
        self._memory.election.forget_until = float("inf")
        return effects

    patch.setattr(Lease, "request_forget", request_forget)


def any_term_is_believed(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(TermWindow, "believes", lambda self, number, now: True)


def nothing_is_agreed(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(lfa.protocol.lease.machine.memory, "digest", lambda agreement: 1)


def any_version_is_read(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(lfa.protocol.lease.machine.lease, "understands", lambda wire: True)


def ended_lives_may_still_grant(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(FailureDetector, "has_ended", lambda self, member: False)


def earlier_incarnation_not_told(patch: pytest.MonkeyPatch) -> None:
    """Neither the others nor the gateway tell, and the leader takes no superseded incarnation in."""
    patch.setattr(lfa.protocol.lease.machine.voting, "note_later", lambda m, incarnation: None)


def highest_number_is_the_latest(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(lfa.protocol.lease.failure_detector, "is_later", lambda one, other: one > other)


def gateway_term_kept_back(patch: pytest.MonkeyPatch) -> None:
    honest = Lease.gateway_term

    def gateway_term(self: Lease, term: Term, now: float, latched: bool = False) -> Any:
        effects = honest(self, term, now, latched)
        self._memory.gateway_term = Term()
        return effects

    patch.setattr(Lease, "gateway_term", gateway_term)


def hello_goes_to_all(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(lfa.protocol.lease.machine.voting, "_greeted", lambda m: "all")
