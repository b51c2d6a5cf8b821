"""The state of the timed lease model: where each number stands, what follows from it, and the invariants I1, I2, I4."""

from __future__ import annotations

from tests.model.checker import State

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
    "not_agreed": "voters bind themselves to a holder that counts longer leases than their bonds allow for",
}


class LeaseState:
    columns = ("robot 1 and its gateway", "robot 2 and its gateway", "robot 3 and its gateway")

    def __init__(
        self,
        issuers: tuple[int, ...],
        act: int,
        deadman: int = 0,
        gateways: bool = False,
        delays: bool = False,
        mutant: str = "",
        odd: int = 0,
    ) -> None:
        """`issuers[k-1]` issues term k. `act` and `deadman` in units of a clock.

        Without `gateways` there is no hint, fence, command or D: leases alone. With `delays` each round is an event of
        its own and ages on its way; without, a voter grants the newest as it leaves (an older one only forbids).
        Robot 1 counts its leases `odd` units longer than the others count theirs: it has another profile (E25).
        """
        assert mutant in ("", *MUTANTS) and (gateways or deadman == 0), (mutant, deadman)
        self.issuer = (-1, *issuers)
        self.terms = tuple(range(1, len(issuers) + 1))
        self.acts = (act + odd, act, act)
        self.act_max, self.deadman, self.gateways, self.mutant = act + odd, deadman, gateways, mutant
        self.delays = delays
        self.grant = RATE_RATIO * (act + deadman) - (mutant == "t_grant_short")
        self.at = (0, *(TERMS + TERM_SIZE * (k - 1) for k in self.terms))

    def initial(self) -> State:
        state = bytearray(TERMS + TERM_SIZE * len(self.terms))
        for k in self.terms:
            self._forget_ages(state, k)
        return bytes(state)

    # --- small ---------------------------------------------------------------------------------------------------

    def _valid(self, s: State | bytearray, k: int) -> bool:
        """A quorum has granted rounds of k that were sent less than T_act ago."""
        at, act = self.at[k], self.acts[s[self.at[k] + HOLDER]]
        return s[at] == OPEN and (s[at + 4] < act) + (s[at + 5] < act) + (s[at + 6] < act) >= 2

    def _agree(self, v: int, holder: int) -> bool:
        """Both count leases alike (E25)."""
        return self.acts[v] == self.acts[holder] or self.mutant == "not_agreed"

    def _ages(self, s: State | bytearray, k: int) -> bool:
        at, act = self.at[k], self.acts[s[self.at[k] + HOLDER]]
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
        b[at + 3] = b[at + 4] = b[at + 5] = b[at + 6] = self.act_max

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
