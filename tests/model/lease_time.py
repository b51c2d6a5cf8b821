"""Time in the timed lease model: clocks that drift, bonds and leases that run out, commands that grow old."""

from __future__ import annotations

from itertools import product

from tests.model.checker import State, Successor
from tests.model.lease_state import (
    ACK_AGE,
    ASKED,
    BOND_LEFT,
    BOND_TERM,
    GATEWAY_STOOD,
    GATEWAYS,
    HOLDER,
    MOTION,
    OBEYED,
    OPEN,
    PROMISED,
    RELEASED,
    ROUND_AGE,
    STOOD,
    UNUSED,
    VOTERS,
    LeaseState,
)


class LeaseTime(LeaseState):
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
                    b[age] = min(self.act_max, b[age] + 1)

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
        at, act = self.at[k], self.acts[b[self.at[k] + HOLDER]]
        if b[at + HOLDER] != self.issuer[k] and b[at + ROUND_AGE] >= act and not self._valid(b, k):
            return False
        count = 0
        for v in VOTERS:
            count += b[at + ACK_AGE + v] < act or (b[5 * v + PROMISED] <= k and b[5 * v + RELEASED] < k)
        return count >= 2
