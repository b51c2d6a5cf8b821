"""The config register as a model, without time: who may write which config, who may vote (I5-I7; lease.md 3.6-3.10).

Robots and a witness (the last id, the tie-breaker while it votes), terms 1..T with fixed issuers, at most `changes`
joint changes to any voters that keep the leader, hand-over, full house, and one restart with empty memory. Bonds are
left out, as if all had run out: whoever may promise and grant by its promises and configs may do so at any time.
Messages are facts: what was sent can be received at any later time, once, often or never. So is what a config says:
anybody may learn any config that was written, without granting it (NACKs and HELLOs teach).

What is to hold is that there is one register, not two: once a quorum has granted a term and while its holder lives, no
lower term can still get a quorum of its own config from voters that live (ONE). With `floor`, a process that starts
again promises nothing below the terms used so far (its wall clock's milliseconds), and ONE must hold whether the
holder lives or not: terms never go back. I5-I7 are checked where configs are written.
"""

from __future__ import annotations

from itertools import product

from tests.model.checker import State, Step, Successor
from tests.model.register_state import (
    ALL,
    ASKED,
    BLANK_PROMISES,
    GIVEN,
    GIVEN_GRANTS,
    GIVEN_VERSION,
    HALF,
    HOLDER,
    ISSUER_LIFE,
    KNOWS,
    LED,
    LIFE,
    PROMISED,
    PROMISES,
    SEQS,
    UNUSED,
    Content,
    RegisterState,
    is_quorum,
)


class Register(RegisterState):
    def successors(self, s: State) -> list[Successor]:
        out: list[Successor] = []
        for k in self.terms:
            status = s[self.at[k]]
            if status == UNUSED:
                self._prepare(s, k, out)
                self._hand_over(s, k, out)
            elif status == ASKED:
                self._promise(s, k, out)
                self._propose(s, k, out)
                self._full_house(s, k, out)
            elif status == GIVEN:
                self._grant_given(s, k, out)
                self._take_over(s, k, out)
            elif status == LED:
                self._grant(s, k, out)
                self._write(s, k, out)
        self._learn(s, out)
        if not any(s[3 * i + LIFE] for i in self.restarts):
            self._restart(s, out)
        return out

    def step(self, event: tuple[object, ...]) -> Step:
        column, text = event[0], event[1]
        assert isinstance(column, int) and isinstance(text, str)
        return Step(column, text % event[2:] if len(event) > 2 else text)

    # --- candidates ----------------------------------------------------------------------------------------------

    def _prepare(self, s: State, k: int, out: list[Successor]) -> None:
        i = self.issuer[k]
        if not self._next_of(s, k, i) or s[3 * i + PROMISED] > k:
            return
        b = bytearray(s)
        b[self.at[k]], b[self.at[k] + ISSUER_LIFE] = ASKED, s[3 * i + LIFE]
        self._promised(b, k, i)
        out.append(((i, "PREPARE(%d), own PROMISE", k), bytes(b), None))

    def _promise(self, s: State, k: int, out: list[Successor]) -> None:
        """A voter refuses whoever knows an older config; a blank one promises as such."""
        asker = 3 * self.issuer[k]
        for v in self.ids:
            if not self.blanks and not self._electors(s, s[asker + KNOWS]) >> 2 * v & 3:
                continue
            if s[3 * v + PROMISED] <= k and s[3 * v + KNOWS] <= s[asker + KNOWS]:
                b = bytearray(s)
                self._promised(b, k, v)
                if b != s:
                    knows = self._name(s[3 * v + KNOWS])
                    out.append(((v, "PROMISE(%d, %s)", k, knows), bytes(b), self._one(b)))

    def _propose(self, s: State, k: int, out: list[Successor]) -> None:
        """An ordinary quorum of the newest config known: (k, 0) is that config re-stamped."""
        i = self.issuer[k]
        knows = s[3 * i + KNOWS]
        if not knows:
            return
        if is_quorum(self._content(s, knows), self._promisers(s, k)):
            b = bytearray(s)
            wrong = self._lead(b, k, i, self._content(s, knows))
            out.append(((i, "quorum: PROPOSE(%d, (%d,0) = %s)", k, k, self._name(knows)), bytes(b), wrong))

    def _full_house(self, s: State, k: int, out: list[Successor]) -> None:
        """Every id promised, blank ones counted, and those who are not blank hold no quorum of the newest config."""
        at, i = self.at[k], self.issuer[k]
        promisers, blank = self._promisers(s, k), s[at + BLANK_PROMISES]
        lives = [[m for m in (2 * v, 2 * v + 1) if (promisers | blank) >> m & 1] for v in self.ids]
        lives = [some for v, some in enumerate(lives) if some or v not in self.spares]
        for house in product(*lives):
            if 2 * i + s[3 * i + LIFE] not in house:
                continue
            named = sum(1 << m for m in house)
            newest = max(s[3 * i + KNOWS], *(s[at + PROMISES + m] for m in house))
            if newest and is_quorum(self._content(s, newest), named & promisers):
                continue
            tie = named & 3 << 2 * self.witness
            content = (named, tie, named, tie, ALL)
            if self.mutant == "full_house_half":
                content = (named, tie, 0, 0, HALF)
            b = bytearray(s)
            wrong = self._lead(b, k, i, content)
            out.append(((i, "full house: PROPOSE(%d, (%d,0))", k, k), bytes(b), wrong))

    # --- voters --------------------------------------------------------------------------------------------------

    def _grant(self, s: State, k: int, out: list[Successor]) -> None:
        at = self.at[k]
        for seq in range(SEQS):
            slot = at + PROMISES + self.members + 2 * seq
            version = self._version(k, seq)
            if not s[slot]:
                break
            for v in self.ids:
                if s[3 * v + PROMISED] > k or s[3 * v + KNOWS] > version or not self._elects(s, version, v):
                    continue
                b = bytearray(s)
                self._granted(b, k, version, v, slot + 1)
                if b != s:
                    out.append(((v, "GRANT(%d, (%d,%d))", k, k, seq), bytes(b), self._one(b)))

    def _grant_given(self, s: State, k: int, out: list[Successor]) -> None:
        at = self.at[k]
        for v in self.ids:
            version = s[at + GIVEN_VERSION]
            if s[3 * v + PROMISED] <= k and s[3 * v + KNOWS] <= version and self._elects(s, version, v):
                b = bytearray(s)
                self._granted(b, k, s[at + GIVEN_VERSION], v, at + GIVEN_GRANTS)
                if b != s:
                    out.append(((v, "GRANT(%d) to robot %d", k, (s[at + HOLDER] + 1) // 2), bytes(b), self._one(b)))

    def _learn(self, s: State, out: list[Successor]) -> None:
        for v in self.ids:
            if s[3 * v + KNOWS] and not any(
                self.issuer[k] == v and s[self.at[k]] in (UNUSED, ASKED) for k in self.terms
            ):
                continue  # it will not stand for election: knowing more, it only refuses more
            for k in self.terms:
                for seq in range(SEQS):
                    slot = self.at[k] + PROMISES + self.members + 2 * seq
                    if s[slot] and s[3 * v + KNOWS] < self._version(k, seq):
                        b = bytearray(s)
                        b[3 * v + KNOWS] = self._version(k, seq)
                        out.append(((v, "learns (%d,%d)", k, seq), bytes(b), None))
            if not s[3 * v + KNOWS] and not self.cold:
                b = bytearray(s)
                b[3 * v + KNOWS] = 1
                out.append(((v, "learns the first config"), bytes(b), None))

    def _restart(self, s: State, out: list[Successor]) -> None:
        for v in self.restarts:
            b = bytearray(s)
            b[3 * v + PROMISED] = (
                max((k for k in self.terms if s[self.at[k]] != UNUSED), default=0) if self.floor else 0
            )
            b[3 * v + KNOWS] = 0
            if self.mutant == "same_life":
                b[3 * v + KNOWS] = 1
            else:
                b[3 * v + LIFE] = 1
            self._drop(b)
            if b != s:
                out.append(((v, "dies and starts again, blank"), bytes(b), self._one(b)))

    # --- leaders -------------------------------------------------------------------------------------------------

    def _write(self, s: State, k: int, out: list[Successor]) -> None:
        """What a leader whose newest version has its quorum may write next: settle a joint config, or begin one."""
        led = self._leads(s, k)
        if led is None:
            return
        leader, seq = led
        if seq + 1 == SEQS:
            return
        voters, tie, previous, _, _ = content = self._content(s, self._version(k, seq))
        if previous:
            self._append(s, k, seq + 1, (voters, tie, 0, 0, HALF), leader, "settles", out)
        elif s[self.used] < self.changes:
            for changed in self._changes(s, leader):
                new = (changed[0], changed[1], voters, tie, HALF)
                if self.mutant == "no_joint":
                    new = (*changed, 0, 0, HALF)
                if changed != content[:2]:
                    self._append(s, k, seq + 1, new, leader, "changes", out)

    def _changes(self, s: State, leader: int) -> list[tuple[int, int]]:
        """All sets of living members with the leader in it, each with its tie-breaker."""
        others = [2 * v + s[3 * v + LIFE] for v in self.ids if v != leader]
        found: list[tuple[int, int]] = []
        for choice in product((0, 1), repeat=len(others)):
            mine = 1 << 2 * leader + s[3 * leader + LIFE]
            voters = mine | sum(1 << m for m, chosen in zip(others, choice, strict=True) if chosen)
            spares = sum((voters >> 2 * v & 3).bit_count() for v in self.spares)
            if 2 * spares >= voters.bit_count() > 0 < spares and self.mutant != "spares_decide":
                continue  # E33
            tie = voters & 3 << 2 * self.witness
            found.append((voters, tie or (mine if self.head_ties else 0)))
        return found

    def _append(
        self, s: State, k: int, seq: int, content: Content, leader: int, verb: str, out: list[Successor]
    ) -> None:
        b = bytearray(s)
        slot = self.at[k] + PROMISES + self.members + 2 * seq
        if verb == "changes":
            b[self.used] += 1
        b[slot] = self._intern(content)
        self._granted(b, k, self._version(k, seq), leader, slot + 1)
        wrong = self._i6(s, k, seq, content) or self._one(b)
        members = self._members(content[0])
        out.append(((leader, verb + ": PROPOSE(%d, (%d,%d) = %s)", k, k, seq, members), bytes(b), wrong))

    def _hand_over(self, s: State, k: int, out: list[Successor]) -> None:
        """A leader gives k to another robot with its config unchanged, version included; its own voter grants first."""
        i = self.issuer[k]
        if not self._next_of(s, k, i):
            return
        for old in self.terms:
            led = self._leads(s, old) if old < k and s[self.at[old]] == LED else None
            if led is None or led[0] != i:
                continue
            version = self._version(old, led[1])
            for heir in (v for v in self.ids if v != self.witness):
                if heir == i:
                    continue
                b = bytearray(s)
                at = self.at[k]
                if self.mutant == "hand_over_writes":
                    wrong = self._lead(b, k, i, self._content(s, version))
                    b[at + HOLDER] = 2 * heir + s[3 * heir + LIFE] + 1
                else:
                    b[at], b[at + GIVEN_VERSION] = GIVEN, version
                    b[at + HOLDER] = 2 * heir + s[3 * heir + LIFE] + 1
                    self._granted(b, k, version, i, at + GIVEN_GRANTS)
                    wrong = self._one(b)
                out.append(((i, "hands over: PROPOSE(%d) for robot %d", k, heir + 1), bytes(b), wrong))

    def _take_over(self, s: State, k: int, out: list[Successor]) -> None:
        """The heir leads when a quorum granted, it has promised nothing above and knows no newer config."""
        at = self.at[k]
        heir, life = divmod(s[at + HOLDER] - 1, 2)
        version = s[at + GIVEN_VERSION]
        if s[3 * heir + LIFE] != life or s[3 * heir + PROMISED] > k or s[3 * heir + KNOWS] != version:
            return
        if is_quorum(self._content(s, version), s[at + GIVEN_GRANTS]):
            b = bytearray(s)
            wrong = self._lead(b, k, heir, self._content(s, version))
            out.append(((heir, "takes over: PROPOSE(%d, (%d,0))", k, k), bytes(b), wrong))
