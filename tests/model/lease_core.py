"""The timed lease core as a model: who may be granted what, on clocks that drift (I1-I4; lease.md 3.3-3.5, 3.10, 4, 5).

Three voters, a gateway for each, and terms 1..T whose issuers are fixed for one exploration. A state is a row of small
numbers (`bytes`), read by offsets. What makes it small without leaving anything out:

- A message that was sent can be received at any later time, once, often or never; so messages are facts in the
  state, and loss, duplication and reordering need no events of their own.
- A hint is free: any voter may answer any PREPARE as if its holder's token had gone (but never its own).
- A leader counts each grant at once. One that reaches it later or never only makes its lease shorter. So the lease is
  a function of the grants that were given, and what a voter grants is the newest round sent: an older one gives the
  voter the same bond and the holder less.
- A leader that is valid commands in every instant, so its newest command ages from the end of its lease, and its
  gateway may obey it until it is D old by the gateway's own clock. Whether it did is left open both ways: it counts
  as obeyed for those who come later, and bars nothing at its own gateway.
- Time: in each tick each clock that times something advances by one unit or stands, but never stands twice running:
  rates differ by up to a factor of two, (1+eps)/(1-eps) = 2, and T_grant = 2 (T_act + D) exactly.
"""

from __future__ import annotations

from tests.model.checker import State, Step, Successor
from tests.model.lease_state import (
    ACK_AGE,
    ASKED,
    BOND_LEFT,
    BOND_TERM,
    FENCED,
    FENCED_TOLD,
    GIVEN_UP,
    HOLDER,
    MOTION,
    OBEYED,
    OPEN,
    PROMISED,
    PROMISES,
    RELEASE_OUT,
    RELEASED,
    ROUND_AGE,
    SETS,
    STOPPED,
    UNUSED,
    VOTERS,
)
from tests.model.lease_time import LeaseTime
from tests.model.voter_rules import may_grant, may_promise


class LeaseCore(LeaseTime):
    def successors(self, s: State) -> list[Successor]:
        out: list[Successor] = []
        for k in self.terms:
            at = self.at[k]
            status = s[at]
            if status == UNUSED:
                self._prepare(s, k, out)
                self._hand_over(s, k, out)
            elif status == ASKED:
                self._promise(s, k, out)
                self._fence(s, k, out)
                self._propose(s, k, out)
            elif status != GIVEN_UP:
                self._grant(s, k, out)
                self._release(s, k, out)
            if s[at + RELEASE_OUT]:
                self._free(s, k, out)
        self._tick(s, out)
        return out

    def step(self, event: tuple[object, ...]) -> Step:
        column, text = event[0], event[1]
        assert (column is None or isinstance(column, int)) and isinstance(text, str)
        return Step(column, text % event[2:] if len(event) > 2 else text)

    # --- the candidate -------------------------------------------------------------------------------------------

    def _prepare(self, s: State, k: int, out: list[Successor]) -> None:
        """A new candidacy, its own voter's promise first; terms of one issuer rise. A valid lease goes on meanwhile."""
        i = self.issuer[k]
        if not self._next_of(s, k, i):
            return
        b = bytearray(s)
        b[self.at[k]] = ASKED
        if self._promises(s, b, k, i):
            wrong = self._obey(b)
            out.append(((i, "PREPARE(%d), own PROMISE(needs_fence=%d)", k, s[5 * i + BOND_TERM]), bytes(b), wrong))

    def _fence(self, s: State, k: int, out: list[Successor]) -> None:
        """FENCE(t, k) reaches the gateway of t's holder, and its FENCED is on the way back."""
        if not self.gateways:
            return
        at, i = self.at[k], self.issuer[k]
        named = s[at + PROMISES] | s[at + PROMISES + 1] | s[at + PROMISES + 2]
        for t in self.terms:
            if not named >> t & 1 or s[at + FENCED_TOLD] >> t & 1 or s[self.at[t] + HOLDER] == i:
                continue
            gateway = self.issuer[t] if self.mutant == "fence_issuer" else s[self.at[t] + HOLDER]
            b = bytearray(s)
            self._raise_floor(b, gateway, 2 * k)
            b[at + FENCED_TOLD] |= 1 << t
            out.append(((gateway, "gateway: FENCED(%d, %d)", t, k), bytes(b), None))

    def _propose(self, s: State, k: int, out: list[Successor]) -> None:
        """A quorum of promises, each naming nothing, its own lease, or one that is fenced; own GRANT first."""
        at, i = self.at[k], self.issuer[k]
        told = s[at + FENCED_TOLD]
        fine = 1 | told
        for t in self.terms:
            if s[self.at[t] + HOLDER] == i and s[self.at[t]] in (OPEN, STOPPED):
                fine |= 1 << t
        if self.mutant == "highest_fenced" and told:
            fine |= (1 << told.bit_length()) - 1
        if sum(s[at + PROMISES + v] & fine != 0 for v in VOTERS) < 2:
            return
        b = bytearray(s)
        self._open(b, k, i)
        b[at + FENCED] = told
        if self.mutant == "highest_fenced" and told:
            b[at + FENCED] = (1 << told.bit_length()) - 2
        if not self._may_grant(b, k, i):
            return  # its own voter refuses: given up
        wrong = self._bind(b, k, i, age=0)
        out.append(((i, "PROPOSE(%d, fenced=%s), own GRANT", k, set(SETS[told]) or "{}"), bytes(b), wrong))

    # --- the voter -----------------------------------------------------------------------------------------------

    def _promise(self, s: State, k: int, out: list[Successor]) -> None:
        for v in VOTERS:
            b = bytearray(s)
            if self._promises(s, b, k, v) and b != s:
                out.append(((v, "PROMISE(%d, needs_fence=%d)", k, s[5 * v + BOND_TERM]), bytes(b), None))

    def _promises(self, s: State, b: bytearray, k: int, v: int) -> bool:
        w, at, i = 5 * v, self.at[k], self.issuer[k]
        bond_term = s[w + BOND_TERM]
        holder = s[self.at[bond_term] + HOLDER] if bond_term else None
        hint = self.gateways and holder != v
        if not self._agree(v, i) or not may_promise(
            k, i, promised=s[w], released=s[w + RELEASED], bond_holder=holder, holder_gone=hint
        ):
            return False
        b[w + PROMISED] = k
        if self.mutant == "hint_is_proof" and bond_term and holder != i:
            b[w + BOND_TERM] = b[w + BOND_LEFT] = bond_term = 0
        b[at + PROMISES + v] |= 1 << bond_term
        self._yield(b, v, k)
        self._rest(b)
        return True

    def _grant(self, s: State, k: int, out: list[Successor]) -> None:
        """A round reaches voter v: of a holder that still sends the newest, with its own voter's grant before it."""
        at = self.at[k]
        holder, age = s[at + HOLDER], s[at + ROUND_AGE]
        sending = s[at] == OPEN and (holder == self.issuer[k] or self._valid(s, k)) and self._may_grant(s, k, holder)
        if self.delays and sending and age:
            b = bytearray(s)
            b[at + ROUND_AGE] = 0
            wrong = self._bind(b, k, holder, age=0)
            out.append(((holder, "PROPOSE(%d), next round, own GRANT", k), bytes(b), wrong))
        for v in VOTERS:
            if self.mutant == "lease_from_ack" and s[at] == OPEN and s[5 * v + BOND_TERM] == k:
                b = bytearray(s)
                b[at + ACK_AGE + v] = 0
                out.append(((holder, "receives the GRANT(%d) of robot %d", k, v + 1), bytes(b), self._i1(b)))
            if not self._may_grant(s, k, v) or (v == holder and sending):
                continue
            if s[at] == STOPPED and s[5 * v + BOND_TERM] in (0, k):
                continue  # binds a free voter to who has stopped: only forbids
            b = bytearray(s)
            wrong = None
            if sending and not self.delays:
                wrong = self._bind(b, k, holder, age=0)
                age = 0
            wrong = wrong or self._bind(b, k, v, age=age)
            if b != s:
                out.append(((v, "GRANT(%d) to robot %d", k, holder + 1), bytes(b), wrong))

    def _may_grant(self, s: State | bytearray, k: int, v: int) -> bool:
        at, w = self.at[k], 5 * v
        bond_term = s[w + BOND_TERM]
        bond_holder = s[self.at[bond_term] + HOLDER] if bond_term else None
        return self._agree(v, s[at + HOLDER]) and may_grant(
            k, s[at + HOLDER], self.issuer[k], SETS[s[at + FENCED]],
            promised=s[w], released=s[w + RELEASED], bond_term=bond_term, bond_holder=bond_holder,
        )  # fmt: skip

    def _bind(self, b: bytearray, k: int, v: int, age: int) -> str | None:
        """Voter v grants k; answers which invariant that breaks."""
        at, w = self.at[k], 5 * v
        wrong = self._i4(b, b[w + BOND_TERM], b[at + HOLDER])
        b[w + PROMISED], b[w + BOND_TERM], b[w + BOND_LEFT] = k, k, self.grant
        if b[at] == OPEN:
            b[at + ACK_AGE + v] = min(b[at + ACK_AGE + v], age)
            self._moves_if_valid(b, k)
        self._yield(b, v, k)
        wrong = wrong or self._i1(b) or self._obey(b)
        self._rest(b)
        return wrong

    def _free(self, s: State, k: int, out: list[Successor]) -> None:
        """RELEASE(k) arrives: it frees a bond of exactly k, and k and below are never granted again."""
        for v in VOTERS:
            w = 5 * v
            if s[w + BOND_TERM] == k:
                b = bytearray(s)
                b[w + RELEASED] = max(b[w + RELEASED], k)
                b[w + BOND_TERM] = b[w + BOND_LEFT] = 0
                self._rest(b)
                out.append(((v, "receives RELEASE(%d)", k), bytes(b), None))

    # --- the holder ----------------------------------------------------------------------------------------------

    def _hand_over(self, s: State, k: int, out: list[Successor]) -> None:
        """Stop under every own term, have the own gateway refuse them, then issue k for the successor.

        Its lease began at a moment that it stamped itself: its newest grant to us. So k ages on its clock from there.
        """
        i = self.issuer[k]
        if not self._next_of(s, k, i):
            return
        for old in self.terms:
            if old >= k or not self._valid(s, old) or s[self.at[old] + HOLDER] != i:
                continue
            for successor in VOTERS:
                w = 5 * successor
                age = self.grant - s[w + BOND_LEFT]
                if successor == i or s[w + BOND_TERM] != old or age >= self.acts[successor] or s[w + PROMISED] > k:
                    continue  # none, or one that would never lead: that only binds voters
                b = bytearray(s)
                self._stop_all(b, i, k, keep_gateway=self.mutant == "hand_over_unconfirmed")
                self._open(b, k, successor)
                b[self.at[k] + ROUND_AGE] = age
                self._rest(b)
                out.append(((i, "stops; hands over: PROPOSE(%d) for robot %d", k, successor + 1), bytes(b), None))

    def _release(self, s: State, k: int, out: list[Successor]) -> None:
        """The holder has stopped under k and all its lower terms, its gateway refuses them: RELEASE(k)."""
        at = self.at[k]
        holder = s[at + HOLDER]
        if s[at + RELEASE_OUT] or not any(s[5 * v + BOND_TERM] == k for v in VOTERS):
            return  # frees nobody now; it may still be sent when it would
        b = bytearray(s)
        self._stop_all(b, holder, k, keep_gateway=self.mutant == "release_unconfirmed")
        b[at + RELEASE_OUT] = 1
        self._rest(b)
        out.append(((holder, "stops; RELEASE(%d)", k), bytes(b), None))
        # A candidate that never counted its quorum never commanded under k: at rest under all lower terms, it gives
        # the grants back without asking its gateway.
        lower = [
            j for j in self.terms if j < k and s[self.at[j] + HOLDER] == holder and s[self.at[j]] in (OPEN, STOPPED)
        ]
        at_rest = not any(s[self.at[j] + MOTION] or self._valid(s, j) for j in lower)
        if self.mutant == "release_given_up_restamp":
            at_rest = True
        if holder == self.issuer[k] and s[at] == OPEN and at_rest and s[OBEYED + holder] != k:
            b = bytearray(s)
            self._stop(b, k)
            b[at + MOTION] = 0
            b[at + RELEASE_OUT] = 1
            self._rest(b)
            out.append(((holder, "gives %d up; RELEASE(%d)", k, k), bytes(b), None))
