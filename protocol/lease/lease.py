"""The lease protocol of one process: leader, lease duration and chain. Rules E1.. are in protocol/README.md.

`Lease` combines the voter (`acceptor.py`), the candidacy (`candidate.py`) and the held term (`holder.py`) of one
process, owns its config, and decides when each of them sends. It never reads a clock: `now` is the process's own
monotonic time [s] in every call, and must not decrease between calls.
"""

from __future__ import annotations

from lfa.protocol.lease.acceptor import Acceptor
from lfa.protocol.lease.candidate import Candidate
from lfa.protocol.lease.effects import AdoptChain, BecomeLeader, Cause, Effect, LeaseExtended, Send, StepDown
from lfa.protocol.lease.election import Election
from lfa.protocol.lease.failure_detector import FailureDetector
from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.membership import VOTERS_MAX, first_config, ids, is_first, led_by, unanimous_config
from lfa.protocol.lease.quorum import electors
from lfa.protocol.lease.reconfiguration import Policy, reshaped
from lfa.protocol.lease.step_down import SLOWEST, PendingRelease
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import (
    NO_TERM,
    Config,
    Fence,
    Fenced,
    Grant,
    Hello,
    LeaseBody,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Release,
    Role,
    Term,
)
from lfa.protocol.mission import Mission
from lfa.protocol.names import WITNESS_ID, robot_name

__all__ = ["AdoptChain", "BecomeLeader", "Effect", "Lease", "LeaseExtended", "Send", "StepDown"]

NEVER = float("inf")
HELLO_HEARTBEATS = 3
LATE_S = 1e-3
"""Tolerance [s]: a round due at most this long before the next tick waits until that tick."""


def gateway_of(robot_id: int) -> str:
    """Return the address of a robot's gateway in `Send.to`."""
    return f"gateway{robot_id}"


class Lease:
    """Voter, candidate and leader of one process; the caller carries out effects in the given order."""

    def __init__(self, me: Member, mission: Mission, timing: Timing, now: float, floor: int) -> None:
        """Start the lease of `me` (id 0: the witness, which votes and never leads).

        `floor` is the wall clock [ms] at boot (small integers in simulation): terms of this incarnation are above it.
        It orders incarnations and is no part of any safety argument.
        """
        self.me = me
        self.config: Config = first_config(mission)
        self.leader: int | None = None
        """Id of the holder of the newest term known; None once its lease has expired by this process's own clock."""
        self.left_out: frozenset[int] = frozenset()
        """Ids of live robots that a leader keeps out of its chain because they are stuck (E22)."""
        self.released = False
        """True if a requested release is complete: the final messages are out and the process may end."""
        self._timing = timing
        self._grant_s = timing.grant_s
        self._election = Election(me, mission, timing, now)
        self._policy = Policy(mission.tiebreak, mission.shrink, len(self._election.all_member_ids))
        self._acceptor = Acceptor(Term(floor), self._grant_s, now)
        self._candidate: Candidate | None = None
        self._holder: Holder | None = None
        self._seen = Term(floor)
        """Highest term known."""
        self._peers = FailureDetector(me, timing.heartbeat_s)
        self._pending_release = PendingRelease(timing.deadman_s)
        self._pending: tuple[Member, Prepare] | None = None
        """Last PREPARE refused because of a bond."""
        self._leader_until = now
        self._hello_at = now
        self._early: list[tuple[Member, Grant]] = []
        """Grants of a term that this process does not know yet."""
        self._elect_after(self._acceptor.silent_until)

    # --- read by the agent --------------------------------------------------------------------------------------

    @property
    def chain(self) -> tuple[int, ...]:
        """Ids of `config.chain`, leader first."""
        return ids(self.config.chain)

    @property
    def term(self) -> Term:
        """Term of the lease that this process holds, else of the config that it follows."""
        return self._holder.term if self._holder is not None else self.config.version.term

    @property
    def role(self) -> Role:
        if self._holder is not None:
            return Role.LEADER
        return Role.FOLLOWER if self.leader is not None and self.me.id in self.chain else Role.WAITING

    @property
    def missing(self) -> tuple[int, ...]:
        """Ids that the first election of the fleet still waits for (E18); empty once a leader is known."""
        return (
            tuple(i for i in self._election.all_member_ids if not self._peers.knows(i)) if is_first(self.config) else ()
        )

    def may_command(self, now: float) -> bool:
        """Return True if leading and `now` is before the lease's expiry (I1, I2)."""
        return self._holder is not None and now < _expiry(self._holder)

    def commanded(self, now: float) -> None:
        """Record that a command as leader was sent at `now` [s]."""
        self._pending_release.commanded_at = now

    # --- input -------------------------------------------------------------------------------------------------

    def receive(self, src: Member, body: LeaseBody, now: float) -> list[Effect]:
        """Process a message of another process or of the own gateway (FENCED: `src.id` is the gateway's robot)."""
        effects: list[Effect] = []
        self._expire(now, effects)
        if not isinstance(body, Fenced):  # a gateway's incarnations are not its robot's
            if src.id == self.me.id:
                return effects  # own message
            self._peers.heard(src, now)
        match body:
            case Propose():
                self._on_propose(src, body, now, effects)
            case Grant():
                self._on_grant(src, body, now, effects)
            case Prepare():
                self._on_prepare(src, body, now, effects)
            case Promise():
                self._on_promise(src, body, now, effects)
            case Nack():
                self._on_nack(src, body, now, effects)
            case Release():
                self._on_release(body, now, effects)
            case Hello():
                self._on_hello(src, body, now, effects)
            case Fenced():
                self._on_fenced(src, body, now, effects)
            case Fence():
                pass  # for gateways only
        return effects

    def tick(self, now: float, again_at: float = float("-inf")) -> list[Effect]:
        """Do what is due at `now` [s]; send a round now if it falls due before `again_at` [s], the next tick."""
        effects: list[Effect] = []
        self._expire(now, effects)
        if now >= self._pending_release.release_at:
            self._stopped(now, effects)
        due_by = max(now, again_at - LATE_S)
        if self._holder is not None and self._candidate is None and due_by >= self._holder.next_round_at:
            self._reshape(now, effects)
        if self._holder is not None and self._candidate is None and due_by >= self._holder.next_round_at:
            self._send_round(self._holder, now, effects)
        if self._candidate is not None:
            self._press(self._candidate, now, effects)
        elif self._holder is None and now >= self._election.at:
            self._stand(now, effects)
        if now >= self._hello_at:
            pause_s = HELLO_HEARTBEATS * self._timing.heartbeat_s
            on_time = now < self._hello_at + pause_s  # so that late ticks do not accumulate
            self._hello_at = (self._hello_at if on_time else now) + pause_s
            if self._is_out(now) and not self._pending_release.closing:
                effects.append(Send("all", Hello(None if is_first(self.config) else self.config.version)))
        if self.leader is not None and self._holder is None and now >= self._leader_until:
            self.leader = None
        return effects

    def next_deadline(self, again_at: float = float("-inf")) -> float:
        """Return the time [s] of the next tick.

        A process that ticks at `again_at` anyway is not woken earlier for a HELLO that it does not need to send, nor
        shortly before for a round.
        """
        at = self._pending_release.release_at
        if self._hello_at >= again_at or self._candidate is not None or self._is_out(self._hello_at):
            at = min(at, self._hello_at)
        if self._holder is not None:
            at = min(at, _expiry(self._holder))
            waits = again_at - LATE_S <= self._holder.next_round_at < again_at
            if self._candidate is None and not waits:
                at = min(at, self._holder.next_round_at)
        elif self.leader is not None:
            at = min(at, self._leader_until)
        if self._candidate is not None:
            at = min(at, self._candidate.deadline)
        elif self._holder is None:
            at = min(at, self._election.at)
        return at

    def hint(self, id: int, incarnation: int, up: bool, now: float) -> list[Effect]:
        """Process a liveliness event, which proves nothing; a leader closes the chain over a vanished follower (E8)."""
        effects: list[Effect] = []
        self._expire(now, effects)
        if up:
            self._peers.appeared(id, incarnation)
        elif id != self.me.id:
            self._peers.vanished(id, incarnation, now)
            if self._holder is not None and self._candidate is None:
                self._reshape(now, effects)
            elif self._holder is None:
                self._on_holder_gone(now, effects)
        return effects

    def gateway_term(self, term: Term, now: float, latched: bool = False) -> list[Effect]:
        """Process the own gateway's state from `sensors`: its highest term, and whether it is latched in that term.

        E10: a leader whose gateway has seen a higher term, or is latched in the present one, raises its own term.
        """
        effects: list[Effect] = []
        self._expire(now, effects)
        self._seen = max(self._seen, term)
        if self._holder is not None and self._candidate is None:
            barred = term > self._holder.term or (latched and term == self._holder.term)
            if barred:
                self._stand(now, effects)
        return effects

    def request_release(self, now: float) -> list[Effect]:
        """Exit cleanly: stop leading and release the voters; `released` turns True, at once if there is no lease."""
        effects: list[Effect] = []
        self._pending_release.closing = True
        self._election.at = NEVER
        self._step_down(now, "released", effects)
        self._drop_candidate(now, effects)
        self.released = self._pending_release.unreleased is None
        return effects

    def request_handover(self, now: float) -> list[Effect]:
        """Hand the lease of a stuck leader to the next in the chain that answers; release it if none does (E16)."""
        effects: list[Effect] = []
        self._expire(now, effects)
        if self._holder is not None:
            self._hand_over(self._holder, now, effects)
        return effects

    def request_forget(self, lost: tuple[Member, ...], now: float) -> list[Effect]:
        """Apply an operator's declaration that the incarnations `lost`, and all earlier ones of their ids, are dead.

        E20: it is valid for one attempt of each present candidate, and is ignored while a leader is known or if a later
        incarnation of one of them was heard.
        """
        effects: list[Effect] = []
        self._expire(now, effects)
        lost = tuple(m for m in lost if m.id in self._election.all_member_ids)
        if self._holder is None and self.leader is None and lost and not self._lives_on(lost):
            self._drop_candidate(now, effects)
            self._election.forget(lost, now)
            self._elect_after(now)
        return effects

    def _lives_on(self, lost: tuple[Member, ...]) -> bool:
        """Return True if one of `lost` is this process, or was heard in a later incarnation."""
        return any(m.id == self.me.id or self._peers.is_superseded(m) for m in lost)

    # --- voting ------------------------------------------------------------------------------------------------

    def _on_prepare(self, src: Member, body: Prepare, now: float, effects: list[Effect]) -> None:
        self._seen = max(self._seen, body.term)
        if self._stands_before(src, body):
            return
        if body.forget and self._lives_on(body.forget):
            effects.append(Send(robot_name(src.id), self._acceptor.refusal(body.term, self.config, now)))
            return
        answer = self._acceptor.prepare(src, body, self.config, now, self._holder_gone())
        if answer is not None:
            effects.append(Send(robot_name(src.id), answer))
        if isinstance(answer, Promise):
            self._yield_to(body.term, now, effects)
            if self._candidate is None:
                self._elect_after(max(now + 2.0 * self._timing.heartbeat_s, self._election.base))
        elif answer is not None and answer.remaining_s > 0.0:
            self._pending = (src, body)  # answered again when the bond ends: it may have overtaken the RELEASE

    def _stands_before(self, src: Member, body: Prepare) -> bool:
        """Return True if this process precedes the candidate `src` in the first election of a fleet (E5)."""
        first = is_first(self.config) and body.version == self.config.version and self.me.id in self._election.may_lead
        return first and not self._pending_release.closing and self._rank(self.me.id) < self._rank(src.id)

    def _on_propose(self, src: Member, body: Propose, now: float, effects: list[Effect]) -> None:
        self._seen = max(self._seen, body.term)
        named = self.me in electors(body.config)
        answer = self._acceptor.propose(src, body, self.config, now) if named else None
        if answer is None and body.config.version < self.config.version:
            answer = self._acceptor.refusal(body.term, self.config, now)
        if isinstance(answer, Nack):
            effects.append(Send(robot_name(src.id), answer))
            return
        if answer is not None and body.holder != self.me:
            effects.append(Send(robot_name(body.holder.id), answer))
        self._yield_to(body.term, now, effects)
        if answer is not None and body.holder != self.me:
            self._step_down(now, "deposed", effects)  # the own voter has granted another holder
        self._adopt(body.config, now, effects)
        if answer is not None and body.holder == self.me:
            self._take_over(body, answer, now, effects)
        self.leader = body.holder.id
        self._leader_until = now + self._grant_s
        self._election.held(now)
        self._elect_after(self._leader_until)

    def _on_release(self, body: Release, now: float, effects: list[Effect]) -> None:
        freed = self._acceptor.release(body.term)
        # A process without a vote has no bond, but waits for the known lease to expire.
        known = self._holder is None and body.term == self.config.version.term and self._acceptor.bound(now) is None
        if not (freed or known):
            return
        self.leader = None
        self._elect_after(now)
        self._answer_pending(now, effects)

    def _on_holder_gone(self, now: float, effects: list[Effect]) -> None:
        """Start the election after the holder's token vanished; answer a PREPARE that came before that event (E15)."""
        if self._acceptor.bound(now) is not None and self._holder_gone() and self._candidate is None:
            self._elect_after(now)
            self._answer_pending(now, effects)

    def _holder_gone(self) -> bool:
        """Return True if the token of the holder that this voter was last bound to has vanished."""
        bond = self._acceptor.bond
        return bond is not None and self._peers.is_gone(bond.holder)

    def _answer_pending(self, now: float, effects: list[Effect]) -> None:
        pending, self._pending = self._pending, None
        if pending is not None:
            self._on_prepare(*pending, now, effects)

    def _yield_to(self, term: Term, now: float, effects: list[Effect]) -> None:
        """Give up an own candidacy lower than `term`, which this process has promised or granted."""
        if self._candidate is not None and term > self._candidate.term:
            self._drop_candidate(now, effects)
            self._elect_after(now + 2.0 * self._timing.heartbeat_s)

    # --- standing for election ---------------------------------------------------------------------------------

    def _rank(self, robot_id: int) -> int:
        return self._election.rank(self.config, robot_id, self._peers)

    def _elect_after(self, at: float) -> None:
        """Schedule the own candidacy by rank, counted from `at` [s] (E6)."""
        if not self._pending_release.closing:
            self._election.after(at, self.config, self._peers)

    def _stand(self, now: float, effects: list[Effect]) -> None:
        """Start a candidacy under a term above all known ones. A leader does so too, to raise its term (E10)."""
        self._elect_after(now + self._grant_s)
        bond = self._acceptor.bound(now)
        if bond is not None and bond.holder != self.me and not self._holder_gone():
            self._elect_after(bond.expiry)
            return
        number = max(self._seen.n, self._acceptor.promised.n) + 1
        forget = self._election.forgotten(now)
        self._candidate = Candidate(Term(number, self.me.id, self.me.incarnation), self._timing, now, forget)
        self._seen = self._candidate.term
        self._press(self._candidate, now, effects)

    def _press(self, candidate: Candidate, now: float, effects: list[Effect]) -> None:
        """Act on the candidacy's deadline: send PREPARE or PROPOSE (again), or give up."""
        if candidate.holder is not None:
            if now >= candidate.gives_up_at:
                self._drop_candidate(now, effects)
                self._elect_after(now + self._timing.rank_step_s)
            elif now >= candidate.holder.next_round_at and not candidate.transferred:
                self._send_round(candidate.holder, now, effects)
        elif candidate.forget and now >= self._election.forget_until:
            self._drop_candidate(now, effects)
            self._elect_after(now)
        elif now >= candidate.ask_at:
            candidate.asked(now)
            request = Prepare(candidate.term, self.config.version, candidate.forget)
            effects.append(Send("all", request))
            own = self._acceptor.prepare(self.me, request, self.config, now, self._holder_gone())
            if isinstance(own, Promise):
                self._on_promise(self.me, own, now, effects)

    def _on_promise(self, src: Member, body: Promise, now: float, effects: list[Effect]) -> None:
        candidate = self._candidate
        if candidate is None or candidate.holder is not None or body.term != candidate.term:
            return
        candidate.promised(src, body.needs_fence, body.blank)
        self._fence_or_propose(candidate, now, effects)

    def _fence_or_propose(self, candidate: Candidate, now: float, effects: list[Effect]) -> None:
        """Send FENCE for each lease that a promiser is bound to; start phase 2 when all gateways confirmed (E15)."""
        lives: tuple[Member, ...] = ()
        candidate.expects_nobody()
        if not candidate.has_quorum(self.config):
            lives = self._election.without_quorum(candidate, self.config, self._peers, now)
            if self.me not in lives:
                return
        for grantee in candidate.fences_to_ask(self.me):
            effects.append(Send(gateway_of(grantee.holder.id), Fence(grantee.term, candidate.term)))
        if not candidate.unfenced(self.me):
            candidate.holder = Holder(self.me, candidate.term, self._timing, now, candidate.fenced_terms)
            if lives:
                config = unanimous_config(self.config, self.me, candidate.term, lives)
            else:
                config = led_by(self.config, self.me, candidate.term, self._peers.is_gone)
            self._adopt(config, now, effects)
            self._send_round(candidate.holder, now, effects)

    def _on_fenced(self, src: Member, body: Fenced, now: float, effects: list[Effect]) -> None:
        if src.id == self.me.id and body.old == self._pending_release.unreleased:
            self._stopped(now, effects)
        candidate = self._candidate
        if candidate is not None and candidate.holder is None and body.term == candidate.term:
            candidate.fenced(src.id, body.old)
            self._fence_or_propose(candidate, now, effects)

    def _drop_candidate(self, now: float, effects: list[Effect]) -> None:
        """Give up the candidacy and release its grants, unless this robot may still move under another term."""
        candidate, self._candidate = self._candidate, None
        if candidate is None or candidate.holder is None or self._holder is not None:
            return
        if now >= self._pending_release.at_rest_at:
            self._acceptor.release(candidate.term)
            effects.append(Send("all", Release(candidate.term)))

    def _on_nack(self, src: Member, body: Nack, now: float, effects: list[Effect]) -> None:
        self._seen = max(self._seen, body.promised, body.config.version.term)
        if body.remaining_s > 0.0 and body.holder != self.me:
            self._election.held(now)
        candidate, holder = self._candidate, self._holder
        newer = body.config.version > self.config.version
        # Every refusal names the promised term: repeating the request under a lower term is useless.
        in_vain = candidate is not None and candidate.holder is None and body.promised > candidate.term
        if candidate is not None and (body.term == candidate.term or in_vain):
            if newer:
                self._adopt(body.config, now, effects)
            overtaken = body.promised > candidate.term
            beaten = overtaken and candidate.refused(src, self.config, self._peers.has_ended)
            if beaten or (newer and candidate.holder is not None):
                self._drop_candidate(now, effects)
                self._elect_after(now + self._timing.rank_step_s)
            elif newer:
                candidate.ask_at = now
                self._press(candidate, now, effects)
            elif body.remaining_s > 0.0:
                candidate.wait_until(now + body.remaining_s * SLOWEST)
        elif candidate is None and holder is not None and body.term == holder.term:
            if newer:
                self._adopt(body.config, now, effects)
            if self._holder is not None and body.promised > holder.term:
                self._stand(now, effects)  # E10
        elif newer and candidate is None and holder is None:
            self._adopt(body.config, now, effects)
            # A holder under that config, if any, sends within a heartbeat, or this refusal names it.
            self._elect_after(now + max(body.remaining_s * SLOWEST, self._timing.heartbeat_s))

    # --- leading -----------------------------------------------------------------------------------------------

    def _send_round(self, holder: Holder, now: float, effects: list[Effect]) -> None:
        """Send one PROPOSE to all; the own voter answers first."""
        propose = holder.next_propose(self.config, now)
        own = self._acceptor.propose(self.me, propose, self.config, now)
        if not isinstance(own, Grant):
            if self._candidate is None:
                self._stand(now, effects)  # E10: a raised term that was given up still binds the own voter
            else:
                self._drop_candidate(now, effects)
            return
        effects.append(Send("all", propose))
        self._count(holder, self.me, own, now, effects)

    def _on_grant(self, src: Member, body: Grant, now: float, effects: list[Effect]) -> None:
        if self._candidate is not None and self._candidate.holder is not None and self._candidate.term == body.term:
            self._count(self._candidate.holder, src, body, now, effects)
        elif self._holder is not None and self._holder.term == body.term:
            self._count(self._holder, src, body, now, effects)
        elif body.term > self.term:
            self._early = [*self._early[1 - VOTERS_MAX :], (src, body)]  # hand-over: PROPOSE still to come

    def _count(self, holder: Holder, src: Member, grant: Grant, now: float, effects: list[Effect]) -> None:
        if not holder.granted(src, grant, self.config, now):
            return
        expiry = _expiry(holder)
        self._election.held(now)
        if holder is self._holder:
            effects.append(LeaseExtended(holder.term, expiry))
            if self.config.previous is not None and self._candidate is None:
                self._reshape(now, effects)  # the joint config may be accepted by now
        elif now < expiry:
            if self._candidate is not None and self._candidate.transferred:
                self._adopt(
                    led_by(self.config, self.me, holder.term, self._peers.is_gone, keep_leader=True), now, effects
                )
            self._candidate, self._holder = None, holder
            self.leader = self.me.id
            effects.append(BecomeLeader(holder.term, expiry))

    def _reshape(self, now: float, effects: list[Effect]) -> None:
        """Write and propose the next config if chain or voters change (E8, E9, E17)."""
        holder = self._holder
        assert holder is not None
        known, policy, timing = self._peers, self._policy, self._timing
        newer = reshaped(self.config, holder, self.me, known, self.left_out, policy, timing, now)
        holder.said_hello.clear()
        if newer is not self.config:
            self._adopt(newer, now, effects)
            self._send_round(holder, now, effects)

    def _on_hello(self, src: Member, body: Hello, now: float, effects: list[Effect]) -> None:
        """Process a HELLO: a leader takes its sender in; without a leader, answer with the newest config (E9)."""
        if self.leader is None and (body.version is None or body.version < self.config.version):
            effects.append(Send(robot_name(src.id), self._acceptor.refusal(NO_TERM, self.config, now)))
        if self._holder is None or src.id not in self._election.all_member_ids or self._peers.is_superseded(src):
            return
        self._holder.heard_at[src] = now
        if src not in self._holder.said_hello:
            self._holder.said_hello.append(src)
        if self._candidate is None:
            self._reshape(now, effects)

    # --- stopping ----------------------------------------------------------------------------------------------

    def _expire(self, now: float, effects: list[Effect]) -> None:
        """Step down if the lease has expired; first action of every call, so that no leader outlasts its lease (E7)."""
        if self._holder is not None and now >= _expiry(self._holder):
            self._step_down(now, "expired", effects)
            # A leader that can send but not receive would keep its voters bound for ever: it becomes silent, and lets
            # others stand first.
            self._elect_after(now + self._grant_s)

    def _step_down(self, now: float, cause: Cause, effects: list[Effect], below: Term | None = None) -> None:
        """Stop leading and fence the own gateway below `below` (default: just above the term), before RELEASE (E4)."""
        holder, self._holder = self._holder, None
        if holder is None:
            return
        self.leader = None
        self._pending_release.begin(holder.term, now)
        effects.append(StepDown(holder.term, cause))
        effects.append(Send(gateway_of(self.me.id), Fence(holder.term, below or _just_above(holder.term))))

    def _stopped(self, now: float, effects: list[Effect]) -> None:
        """Send RELEASE or the transfer proposal: the own gateway refuses the term, or its last command is too old."""
        term, transfer_proposal = self._pending_release.end()
        self.released = self._pending_release.closing
        if term is None:
            return
        own = (
            None if transfer_proposal is None else self._acceptor.propose(self.me, transfer_proposal, self.config, now)
        )
        if transfer_proposal is not None and isinstance(own, Grant):
            effects.append(Send("all", transfer_proposal))
            effects.append(Send(robot_name(transfer_proposal.holder.id), own))
            self.leader, self._leader_until = transfer_proposal.holder.id, now + self._grant_s
        else:
            self._acceptor.release(term)
            effects.append(Send("all", Release(term)))

    # --- handing over ------------------------------------------------------------------------------------------

    def _hand_over(self, holder: Holder, now: float, effects: list[Effect]) -> None:
        """Stop, then ask the voters to bind themselves to the successor under a new term of this process (E16).

        The successor's lease starts at its own nonce, so that only its own clock is used. The config stays unchanged,
        version included: the new leader writes a new one after its quorum.
        """
        successor = self._successor(holder, now)
        if successor is not None:
            life, nonce = successor
            term = Term(max(self._seen.n, holder.term.n) + 1, self.me.id, self.me.incarnation)
            self._seen = term
            self._pending_release.transfer_proposal = Propose(term, self.config, 0, life, nonce=nonce)
        self._drop_candidate(now, effects)
        transfer_proposal = self._pending_release.transfer_proposal
        self._step_down(now, "handed_over", effects, None if transfer_proposal is None else transfer_proposal.term)
        self._elect_after(now + self._grant_s)

    def _successor(self, holder: Holder, now: float) -> tuple[Member, float] | None:
        """Return the first follower that may lead and was heard within t_chain, with the nonce of its last grant."""
        for member in self.config.chain[1:]:
            nonce = holder.nonces.get(member)
            fit = (
                member.id in self._election.may_lead
                and member in self.config.voters
                and not self._peers.is_gone(member)
            )
            if fit and nonce is not None and not holder.silent(member, now, self._timing.chain_silence_s):
                return member, nonce
        return None

    def _take_over(self, body: Propose, own: Grant, now: float, effects: list[Effect]) -> None:
        """Take over a term handed to this process; count its grants, also those that came before the PROPOSE (E16)."""
        if body.nonce is None or self._holder is not None or self._candidate is not None:
            return
        candidate = Candidate(body.term, self._timing, now)
        candidate.transferred = True
        candidate.holder = Holder(self.me, body.term, self._timing, now)
        candidate.holder.transferred(body.round, body.nonce)
        self._candidate = candidate
        early, self._early = self._early, []
        for src, grant in [(self.me, own), *early]:
            if self._candidate is candidate and grant.term == body.term:
                self._count(candidate.holder, src, grant, now, effects)

    # --- helpers -----------------------------------------------------------------------------------------------

    def _adopt(self, config: Config, now: float, effects: list[Effect]) -> None:
        """Adopt `config` if newer; step down if another leads it, as the own lease is then fenced or expired."""
        if config.version > self.config.version:
            if config.chain[0] != self.me:
                self._step_down(now, "deposed", effects)
            self.config = config
            effects.append(AdoptChain(config))

    def _is_out(self, now: float) -> bool:
        """Return True if bound by no grant (always so for a learner) or absent from the leader's chain (E9)."""
        if self._holder is not None:
            return False
        if self.me.id != WITNESS_ID and self.me not in self.config.chain:
            return True
        return self.me not in self.config.voters or self._acceptor.bound(now) is None


def _expiry(holder: Holder) -> float:
    """Return the expiry [s] of a held lease; -inf before a quorum has granted it."""
    return float("-inf") if holder.expiry is None else holder.expiry


def _just_above(term: Term) -> Term:
    """Return the least term above `term`."""
    return Term(term.n, term.issuer, term.incarnation + 1)
