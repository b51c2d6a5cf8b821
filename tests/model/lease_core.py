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

from itertools import product

from tests.model.checker import State, Step, Successor
from tests.model.voter_rules import may_grant, may_promise

VOTERS = (0, 1, 2)
RATE_RATIO = 2
UNUSED, ASKED, OPEN, STOPPED, GIVEN_UP = range(5)
"""A term: not yet used; PREPARE is out; PROPOSE is out; its holder has stopped for good; dropped before a PROPOSE."""
SETS = tuple(frozenset(k for k in range(5) if mask >> k & 1) for mask in range(32))

#                 voter v at 5 v
PROMISED, RELEASED, BOND_TERM, BOND_LEFT, STOOD = range(5)
#                 gateway of v at 15 + 2 v. A gateway obeys terms k with 2k >= its floor: 2k+1 is "just above k"
GATEWAYS = 15
FLOOR, GATEWAY_STOOD = range(2)
OBEYED = 21
"""+ v: the highest term under which the gateway of v may have obeyed a leader."""
#                 term k at 24 + 13 (k-1)
TERMS, TERM_SIZE = 24, 13
STATUS, HOLDER, FENCED, ROUND_AGE, ACK_AGE, PROMISES, FENCED_TOLD, RELEASE_OUT, MOTION = 0, 1, 2, 3, 4, 7, 10, 11, 12
"""ROUND_AGE and ACK_AGE + v: by the holder's clock, of the newest round, and of the newest that v granted.
PROMISES + v: bit t is set when v sent a PROMISE that names term t as still to be fenced, bit 0 for one that names none.
FENCED_TOLD: bit t when FENCED(t) was sent. MOTION: how long the newest command may still be obeyed."""

MUTANTS = {
    "t_grant_short": "T_grant is one unit too short",
    "release_unconfirmed": "RELEASE before the own gateway's confirmation",
    "hand_over_unconfirmed": "hand-over before the own gateway's confirmation",
    "release_given_up_restamp": "RELEASE of a re-stamp that was given up, while the old lease runs",
    "fence_issuer": "needs_fence without the holder: the gateway of the term's issuer is fenced",
    "highest_fenced": "one highest fenced term instead of a set",
    "early_restamp": "acting under a re-stamped term before its quorum",
    "hint_is_proof": "a vanished token voids the bond",
    "lease_from_ack": "the lease runs from when the grant arrived, not from when it was asked",
    "stamp_after_check": "the gateway stamp is read after the lease check",
}


class LeaseCore:
    columns = ("robot 1 and its gateway", "robot 2 and its gateway", "robot 3 and its gateway")

    def __init__(
        self,
        issuers: tuple[int, ...],
        act: int,
        deadman: int = 0,
        gateways: bool = False,
        delays: bool = False,
        mutant: str = "",
    ) -> None:
        """`issuers[k-1]` issues term k. `act` and `deadman` in units of a clock.

        Without `gateways` there is no hint, fence, command or D: leases alone. With `delays` each round is an event of
        its own and ages on its way; without, a voter grants the newest as it leaves (an older one only forbids).
        """
        assert mutant in ("", *MUTANTS) and (gateways or deadman == 0), (mutant, deadman)
        self.issuer = (-1, *issuers)
        self.terms = tuple(range(1, len(issuers) + 1))
        self.act, self.deadman, self.gateways, self.mutant = act, deadman, gateways, mutant
        self.delays = delays
        self.grant = RATE_RATIO * (act + deadman) - (mutant == "t_grant_short")
        self.at = (0, *(TERMS + TERM_SIZE * (k - 1) for k in self.terms))

    def initial(self) -> State:
        state = bytearray(TERMS + TERM_SIZE * len(self.terms))
        for k in self.terms:
            self._forget_ages(state, k)
        return bytes(state)

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
        if not may_promise(k, i, promised=s[w], bond_holder=holder, holder_gone=hint):
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
        return may_grant(
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
                if successor == i or s[w + BOND_TERM] != old or age >= self.act or s[w + PROMISED] > k:
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

    # --- time ----------------------------------------------------------------------------------------------------

    def _tick(self, s: State, out: list[Successor]) -> None:
        """Each clock that times something advances or stands; the others' rates do not matter.

        Where one rate only forbids, it is left out: a voter that holds nothing and can be handed nothing runs fast,
        a gateway slow.
        """
        clocks: list[tuple[int, tuple[bool, ...]]] = []
        for v in VOTERS:
            times_lease = self._times_lease(s, v)
            bond_term = s[5 * v + BOND_TERM]
            if times_lease or bond_term:
                heir = bond_term and s[self.at[bond_term]] == OPEN
                free = (times_lease or heir) and not s[5 * v + STOOD]
                clocks.append((v, (True, False) if free else (True,)))
        moving = [v for v in VOTERS if self._moves_on(s, v)] if self.deadman else []
        if not clocks and not moving:
            return
        for advances in product(*(choices for _, choices in clocks)):
            b = bytearray(s)
            who: list[str] = []
            for v in moving:
                stood = GATEWAYS + 2 * v + GATEWAY_STOOD
                b[stood] ^= 1
                if s[stood]:
                    self._gateway_advances(b, s, v)
                    who.append(f"gateway {v + 1}")
            for (v, _), advance in zip(clocks, advances, strict=True):
                b[5 * v + STOOD] = not advance
                if advance:
                    self._advance(b, v)
                    who.append(f"robot {v + 1}")
            self._rest(b)
            out.append(((None, "a tick; clocks that advance: %s", ", ".join(who) or "none"), bytes(b), None))

    def _times_lease(self, s: State | bytearray, v: int) -> bool:
        for k in self.terms:
            at = self.at[k]
            if s[at] == OPEN and s[at + HOLDER] == v and self._ages(s, k):
                return True
        return False

    def _moves_on(self, s: State | bytearray, v: int) -> bool:
        """Its lease is over, its last command is not yet D old."""
        for k in self.terms:
            at = self.at[k]
            if s[at + MOTION] and s[at + HOLDER] == v and not self._valid(s, k):
                return True
        return False

    def _advance(self, b: bytearray, v: int) -> None:
        w = 5 * v
        if b[w + BOND_TERM]:
            b[w + BOND_LEFT] -= 1
            if not b[w + BOND_LEFT]:
                b[w + BOND_TERM] = 0
        for k in self.terms:
            at = self.at[k]
            if b[at] == OPEN and b[at + HOLDER] == v:
                for age in (at + ROUND_AGE, at + ACK_AGE, at + ACK_AGE + 1, at + ACK_AGE + 2):
                    b[age] = min(self.act, b[age] + 1)

    def _gateway_advances(self, b: bytearray, s: State, v: int) -> None:
        if self.mutant == "stamp_after_check":
            return  # a process that paused between check and stamp sends a command that is always fresh
        for k in self.terms:
            at = self.at[k]
            if s[at + HOLDER] == v and s[at + MOTION] and not self._valid(s, k):
                b[at + MOTION] -= 1

    def _rest(self, b: bytearray) -> None:
        """A clock that times nothing any more has no past, a lease that can never be valid again no ages."""
        for k in self.terms:
            if b[self.at[k]] == OPEN and not self._can_be_valid(b, k):
                self._stop(b, k)
        for v in VOTERS:
            if b[5 * v + STOOD] and not b[5 * v + BOND_TERM] and not self._times_lease(b, v):
                b[5 * v + STOOD] = 0
            stood = GATEWAYS + 2 * v + GATEWAY_STOOD
            if b[stood] and not self._moves_on(b, v):
                b[stood] = 0
            if b[OBEYED + v] and not self._can_follow(b, v):
                b[OBEYED + v] = 0

    def _can_follow(self, b: bytearray, v: int) -> bool:
        """Some lower term of another holder than v may yet command, so that what v's gateway obeyed matters."""
        for j in range(1, b[OBEYED + v]):
            at = self.at[j]
            if b[at] in (UNUSED, ASKED):
                return True
            fenced = b[GATEWAYS + 2 * b[at + HOLDER]] > 2 * j
            if b[at + HOLDER] != v and not fenced and (b[at] == OPEN or b[at + MOTION]):
                return True
        return False

    def _can_be_valid(self, b: bytearray, k: int) -> bool:
        """Two voters' grants are young or may still come; what was handed over needs its first round's age for that."""
        at, act = self.at[k], self.act
        if b[at + HOLDER] != self.issuer[k] and b[at + ROUND_AGE] >= act and not self._valid(b, k):
            return False
        count = 0
        for v in VOTERS:
            count += b[at + ACK_AGE + v] < act or (b[5 * v + PROMISED] <= k and b[5 * v + RELEASED] < k)
        return count >= 2

    # --- small ---------------------------------------------------------------------------------------------------

    def _valid(self, s: State | bytearray, k: int) -> bool:
        """A quorum has granted rounds of k that were sent less than T_act ago."""
        at, act = self.at[k], self.act
        return s[at] == OPEN and (s[at + 4] < act) + (s[at + 5] < act) + (s[at + 6] < act) >= 2

    def _ages(self, s: State | bytearray, k: int) -> bool:
        at, act = self.at[k], self.act
        return s[at + 3] < act or s[at + 4] < act or s[at + 5] < act or s[at + 6] < act

    def _next_of(self, s: State, k: int, i: int) -> bool:
        """All of i's lower terms are used, none of its higher ones."""
        return all((s[self.at[j]] != UNUSED) == (j < k) for j in self.terms if j != k and self.issuer[j] == i)

    def _open(self, b: bytearray, k: int, holder: int) -> None:
        at = self.at[k]
        assert b[at] in (UNUSED, ASKED), "I3: a term has one holder"
        b[at], b[at + HOLDER] = OPEN, holder
        if self.delays:
            b[at + ROUND_AGE] = 0
        b[at + FENCED_TOLD] = b[at + PROMISES] = b[at + PROMISES + 1] = b[at + PROMISES + 2] = 0

    def _stop(self, b: bytearray, k: int) -> None:
        b[self.at[k]] = STOPPED
        self._forget_ages(b, k)

    def _forget_ages(self, b: bytearray, k: int) -> None:
        at = self.at[k]
        b[at + 3] = b[at + 4] = b[at + 5] = b[at + 6] = self.act

    def _drop(self, b: bytearray, j: int) -> None:
        at = self.at[j]
        b[at] = GIVEN_UP
        b[at + FENCED_TOLD] = b[at + PROMISES] = b[at + PROMISES + 1] = b[at + PROMISES + 2] = 0

    def _yield(self, b: bytearray, v: int, k: int) -> None:
        """Whoever promises or grants k drops its lower candidacies, and what was handed over to it and not yet held."""
        for j in self.terms:
            if j >= k:
                break
            if b[self.at[j]] == ASKED and self.issuer[j] == v:
                self._drop(b, j)
            elif b[self.at[j]] == OPEN and b[self.at[j] + HOLDER] == v and not self._valid(b, j):
                self._stop(b, j)

    def _stop_all(self, b: bytearray, i: int, k: int, keep_gateway: bool) -> None:
        for j in self.terms:
            if j <= k and b[self.at[j]] == OPEN and b[self.at[j] + HOLDER] == i:
                self._stop(b, j)
            elif j <= k and b[self.at[j]] == ASKED and self.issuer[j] == i:
                self._drop(b, j)
        if self.gateways and not keep_gateway:
            self._raise_floor(b, i, 2 * k + 1 if b[self.at[k]] != UNUSED else 2 * k)

    def _raise_floor(self, b: bytearray, v: int, floor: int) -> None:
        b[GATEWAYS + 2 * v] = max(b[GATEWAYS + 2 * v], floor)
        for k in self.terms:
            if b[self.at[k] + HOLDER] == v and 2 * k < b[GATEWAYS + 2 * v]:
                b[self.at[k] + MOTION] = 0

    def _moves_if_valid(self, b: bytearray, k: int) -> None:
        at = self.at[k]
        if self.deadman and b[GATEWAYS + 2 * b[at + HOLDER]] <= 2 * k and self._valid(b, k):
            b[at + MOTION] = self.deadman

    def _commands(self, b: bytearray, k: int) -> int | None:
        """Whose gateway would obey a leader command under k, if any."""
        at = self.at[k]
        v = b[at + HOLDER]
        commands = b[at + MOTION] > 0 or self._valid(b, k)
        if self.mutant == "early_restamp" and b[at] in (ASKED, OPEN):
            v = self.issuer[k]
            commands |= any(b[self.at[j] + HOLDER] == v and self._valid(b, j) for j in self.terms if j < k)
        return v if commands and b[GATEWAYS + 2 * v] <= 2 * k else None

    # --- invariants ----------------------------------------------------------------------------------------------

    def _i1(self, b: bytearray) -> str | None:
        """Two leases of different holders are valid, and the lower one is not fenced at its holder's gateway."""
        valid = [k for k in self.terms if self._valid(b, k)]
        for low in valid:
            holder = b[self.at[low] + HOLDER]
            for high in valid:
                if low < high and holder != b[self.at[high] + HOLDER] and b[GATEWAYS + 2 * holder] <= 2 * low:
                    return f"I1: leases {low} and {high} are both valid, and {low} is not fenced"
        return None

    def _obey(self, b: bytearray) -> str | None:
        """I2 over all gateways; whatever may be obeyed now counts as obeyed from now on."""
        if not self.gateways:
            return None
        able = [(k, v) for k in self.terms if (v := self._commands(b, k)) is not None]
        for k, v in able:
            b[OBEYED + v] = max(b[OBEYED + v], k)
        for k, v in able:
            for u in VOTERS:
                if u != v and b[OBEYED + u] > k:
                    return (
                        f"I2: robot {v + 1} can still be obeyed as leader of {k} after robot {u + 1} of {b[OBEYED + u]}"
                    )
        return None

    def _i4(self, s: bytearray, bond_term: int, holder: int) -> str | None:
        """The voter gave a grant although another is live, unreleased and unfenced."""
        bond_holder = s[self.at[bond_term] + HOLDER]
        if not bond_term or bond_holder == holder or s[GATEWAYS + 2 * bond_holder] > 2 * bond_term:
            return None
        if not self.gateways and s[self.at[bond_term]] == STOPPED:
            return None  # without gateways a stop is a stop
        return (
            f"I4: a grant for robot {holder + 1}, while a live one of term {bond_term} is neither released nor fenced"
        )
