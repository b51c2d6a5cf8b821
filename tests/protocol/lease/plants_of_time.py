"""How the rules of voters, of lease time and of gateways are broken on purpose, each by a patch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from msgspec import structs

import lfa.protocol.lease.holder
from lfa.deploy.fuzz import schedules
from lfa.deploy.fuzz.lease_simulation import LeaseSimulation
from lfa.protocol.lease.acceptor import Acceptor
from lfa.protocol.lease.effects import StepDown
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.machine import lease, resigning
from lfa.protocol.lease.machine.deadlines import DEADLINES, dues_by_state, wakes_by_state
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.machine.memory import LeaseMemory
from lfa.protocol.lease.machine.table import LeaseEvent
from lfa.protocol.lease.step_down import PendingRelease
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import Config, Fenced, Grantee, Member, Nack, Promise, Propose, Term
from lfa.protocol.transport.links import Links
from lfa.world.virtual_time import LocalClock
from tests.protocol.lease import test_usual_bugs

Plant = Callable[[pytest.MonkeyPatch], None]


def counted_from_the_grant(patch: pytest.MonkeyPatch) -> None:
    honest = Holder.granted

    def granted(self: Holder, src: Any, grant: Any, config: Config, now: float) -> bool:
        self._rounds[grant.round] = now, now + self.timing.act_s
        return honest(self, src, grant, config, now)

    patch.setattr(Holder, "granted", granted)


def bond_as_short_as_the_lease(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Timing, "grant_s", property(lambda self: self.act_s))


def bond_of_half_the_lease(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Timing, "grant_s", property(lambda self: self.act_s / 2.0))


def shorter_round_shortens_the_bond(patch: pytest.MonkeyPatch) -> None:
    def kept_until(self: Acceptor, body: Propose, now: float) -> float:
        return now + (body.grant_ms / 1000.0 or self._grant_s)

    patch.setattr(Acceptor, "kept_until", kept_until)


def round_that_asks_for_less(patch: pytest.MonkeyPatch) -> None:
    honest = Holder.next_propose

    def next_propose(self: Holder, config: Config, now: float) -> Propose:
        self._until = float("-inf")
        return honest(self, config, now)

    patch.setattr(Holder, "next_propose", next_propose)


def lease_as_long_as_is_asked_for_now(patch: pytest.MonkeyPatch) -> None:
    honest = Holder.granted

    def granted(self: Holder, src: Any, grant: Any, config: Config, now: float) -> bool:
        sent_at, _ = self._rounds[grant.round]
        self._rounds[grant.round] = sent_at, sent_at + self.timing.act_s
        return honest(self, src, grant, config, now)

    patch.setattr(Holder, "granted", granted)


def bond_ignored(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Acceptor, "bound", lambda self, now: None)


def release_before_the_stop_is_confirmed(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(PendingRelease, "at_rest_at", float("-inf"))


def released_term_granted_again(patch: pytest.MonkeyPatch) -> None:
    honest = Acceptor.release

    def release(self: Acceptor, term: Term) -> bool:
        freed = honest(self, term)
        self.released = Term()
        return freed

    patch.setattr(Acceptor, "release", release)


def expired_leader_goes_on(patch: pytest.MonkeyPatch) -> None:
    """It leads and asks on, and its gateway alone still refuses."""
    patch.setattr(Lease, "may_command", lambda self, now: self._memory.holder is not None)
    deaf_leader_goes_on_asking(patch)


def silence_of_four_heartbeats(patch: pytest.MonkeyPatch) -> None:
    honest = Holder.silent
    patch.setattr(Holder, "silent", lambda self, member, now, s: honest(self, member, now, s / 4.0))


def terms_begin_again_at_a_restart(patch: pytest.MonkeyPatch) -> None:
    honest = Lease.__init__
    patch.setattr(
        Lease,
        "__init__",
        lambda self, me, mission, timing, now, floor, *more: honest(self, me, mission, timing, now, 0, *more),
    )


def gateway_without(reason: str) -> Plant:
    def plant(patch: pytest.MonkeyPatch) -> None:
        honest = Gateway._objection

        def objection(self: Gateway, cmd: Any, now: float) -> str | None:
            found = honest(self, cmd, now)
            return None if found == reason else found

        patch.setattr(Gateway, "_objection", objection)

    return plant


def fence_without_effect(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Gateway, "fence", lambda self, fence, now: Fenced(fence.old, fence.term))


def wall_clock_in_lease_arithmetic(patch: pytest.MonkeyPatch) -> None:
    honest = LeaseSimulation.step_wall

    def step_wall(self: LeaseSimulation, robot_id: int, by_s: float) -> None:
        honest(self, robot_id, by_s)
        process = self.processes[robot_id]
        process.clock = LocalClock(process.clock.offset_s + by_s, process.clock.rate)
        process.wakes_at = self.now
        self.at(self.now, self._wake, process)

    patch.setattr(LeaseSimulation, "step_wall", step_wall)


def lease_end_not_told(patch: pytest.MonkeyPatch) -> None:
    honest = resigning.step_down

    def step_down(m: LeaseMemory, now: float, cause: Any, below: Term | None = None) -> None:
        honest(m, now, cause, below)
        m.effects = [effect for effect in m.effects if not (isinstance(effect, StepDown) and cause == "expired")]

    patch.setattr(resigning, "step_down", step_down)


def refusal_raises_the_promise(patch: pytest.MonkeyPatch) -> None:
    honest = Acceptor.prepare

    def prepare(self: Acceptor, src: Any, body: Any, *arguments: Any) -> Any:
        answer = honest(self, src, body, *arguments)
        if isinstance(answer, Nack):
            self.promised = max(self.promised, body.term)
        return answer

    patch.setattr(Acceptor, "prepare", prepare)


def deaf_leader_goes_on_asking(patch: pytest.MonkeyPatch) -> None:
    """It commands no more, but its PROPOSEs keep the voters bound."""
    others = tuple(deadline for deadline in DEADLINES if deadline.event is not LeaseEvent.LEASE_EXPIRED)
    patch.setattr(lease, "DEADLINES", others)
    patch.setattr(lease, "WAKES", wakes_by_state(others))
    patch.setattr(lease, "DUES", dues_by_state(others))
    patch.setattr(Lease, "_expire", lambda self, now: None)


def clocks_a_quarter_wrong(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(test_usual_bugs, "RATE_ERROR", 0.25)
    patch.setattr(schedules, "CLOCK_RATE_ERROR", 0.25)


def promises_up_to_a_released_term(patch: pytest.MonkeyPatch) -> None:
    honest = Acceptor.release

    def release(self: Acceptor, term: Term) -> bool:
        promised = self.promised
        freed = honest(self, term)
        self.promised = promised
        return freed

    patch.setattr(Acceptor, "release", release)


def one_try_a_heartbeat(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(lfa.protocol.lease.holder, "RETRY_HEARTBEATS", 1.0)


def needs_fence_without_the_holder(patch: pytest.MonkeyPatch) -> None:
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


def one_highest_fenced_term(patch: pytest.MonkeyPatch) -> None:
    honest = Acceptor.propose

    def propose(self: Acceptor, src: Any, body: Propose, config: Config, now: float) -> Any:
        bond = self.bound(now)
        if bond is not None and body.fenced and bond.term <= max(body.fenced):
            fenced = (*body.fenced, bond.term)
            body = Propose(body.term, body.config, body.round, body.holder, fenced, body.nonce, body.agreed)
        return honest(self, src, body, config, now)

    patch.setattr(Acceptor, "propose", propose)


def rounds_that_restart(patch: pytest.MonkeyPatch) -> None:
    honest = Holder.transferred

    def given(self: Holder, number: int, since: float) -> None:
        honest(self, number, since)
        self._round = 0

    patch.setattr(Holder, "transferred", given)


def stamp_read_after_the_check(patch: pytest.MonkeyPatch) -> None:
    """What a pause holds back gets a fresh stamp before it leaves."""
    honest = LeaseSimulation.resume

    def resume(self: LeaseSimulation, robot_id: int, shuffled: bool = False) -> None:
        process, stamp = self.processes[robot_id], self.stamp(robot_id)
        if process.paused and process.drawn is not None and stamp is not None:
            process.drawn = structs.replace(process.drawn, gateway=stamp)
        honest(self, robot_id, shuffled)

    patch.setattr(LeaseSimulation, "resume", resume)


def declared_again_after_events_only(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Links, "lacks", lambda *_: None)
