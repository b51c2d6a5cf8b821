"""The state of the config model: lives, versions and who promised or granted what; the invariants I6 and ONE."""

from __future__ import annotations

from tests.model.checker import State

SEQS = 3
"""Versions of a term: as it was re-stamped, joint, and settled."""
HALF, ALL = 0, 1
UNUSED, ASKED, GIVEN, LED, DROPPED = range(5)
"""A term: not used; PREPARE is out; handed over; (term, 0) is written; nobody can write (term, 0) any more."""

Content = tuple[int, int, int, int, int]
"""Voters (mask of members), tie-breaker (mask of one or none), previous voters or 0, their tie-breaker, their rule.
A member is one life of an id: bit 2 id for the first, bit 2 id + 1 for the one after the restart."""

#                   id i at 3 i
LIFE, PROMISED, KNOWS = range(3)
"""KNOWS: the version known, counted from 1; 0: blank."""
STATUS, ISSUER_LIFE, HOLDER, GIVEN_VERSION, GIVEN_GRANTS, BLANK_PROMISES, PROMISES = range(7)
"""HOLDER: a member, counted from 1. PROMISES + m: the oldest version that member m promised with."""

MUTANTS = {
    "hand_over_writes": "hand-over that writes a new config without phase 1",
    "full_house_half": "full house without the joint rule `all`",
    "no_joint": "a change of voters without a joint config",
    "same_life": "a restarted process votes at once, as its old life, with the first config",
    "spares_decide": "a spare votes like a robot that the mission names",
}


def half(voters: int, tie: int, present: int) -> bool:
    count = 2 * (voters & present).bit_count()
    return count > voters.bit_count() or (count == voters.bit_count() and bool(tie & present))


def is_quorum(content: Content, present: int) -> bool:
    voters, tie, previous, previous_tie, rule = content
    if not half(voters, tie, present):
        return False
    if not previous:
        return True
    return previous & present == previous if rule == ALL else half(previous, previous_tie, present)


class RegisterState:
    def __init__(
        self,
        robots: int,
        issuers: tuple[int, ...],
        changes: int,
        restarts: tuple[int, ...] = (),
        cold: bool = False,
        head_ties: bool = False,
        floor: bool = False,
        mutant: str = "",
        spare: bool = False,
    ) -> None:
        """`restarts`: the ids of which one may die and start again. `cold`: everybody starts blank.
        `head_ties`: without the witness, the leader that writes is tie-breaker. `spare`: one more robot, with the last
        id, runs, and the mission does not name it (E33).
        """
        assert mutant in ("", *MUTANTS), mutant
        self.ids = tuple(range(robots + 1 + spare))
        self.witness = robots
        self.spares = self.ids[robots + 1 :]
        self.columns = (*(f"robot {i + 1}" for i in range(robots)), "witness", *("spare" for _ in self.spares))
        self.issuer = (-1, *issuers)
        self.terms = tuple(range(1, len(issuers) + 1))
        self.changes, self.restarts, self.cold, self.head_ties, self.mutant = changes, restarts, cold, head_ties, mutant
        self.floor = floor
        self.lasting = floor or not restarts
        """ONE also counts terms whose holder has died."""
        self.blanks = cold or bool(restarts) or spare
        """Without blank processes there is no full house: nobody but voters need promise, no promise keep a version."""
        self.members = 2 * len(self.ids)
        self.used = 3 * len(self.ids)
        """Where the number of joint changes stands."""
        self.term_size = PROMISES + self.members + 2 * SEQS
        self.at = (0, *(self.used + 1 + self.term_size * (k - 1) for k in self.terms))
        first = sum(1 << 2 * i for i in self.ids if i not in self.spares)
        self.contents: list[Content] = [(first, 1 << 2 * self.witness, 0, 0, HALF)]
        self._number = {self.contents[0]: 0}

    def initial(self) -> State:
        s = bytearray(self.used + 1 + self.term_size * len(self.terms))
        if not self.cold:
            for i in self.ids:
                s[3 * i + KNOWS] = 1
        return bytes(s)

    # --- small ---------------------------------------------------------------------------------------------------

    def _version(self, k: int, seq: int) -> int:
        return 2 + (k - 1) * SEQS + seq

    def _name(self, version: int) -> str:
        if version < 2:
            return ("blank", "the first config")[version]
        return f"({1 + (version - 2) // SEQS},{(version - 2) % SEQS})"

    def _members(self, mask: int) -> str:
        names = [self.columns[m // 2] + "'" * (m % 2) for m in range(self.members) if mask >> m & 1]
        return "{" + ", ".join(names) + "}"

    def _content(self, s: State | bytearray, version: int) -> Content:
        if version == 1:
            return self.contents[0]
        k, seq = divmod(version - 2, SEQS)
        return self.contents[s[self.at[k + 1] + PROMISES + self.members + 2 * seq] - 1]

    def _intern(self, content: Content) -> int:
        """Its number, counted from 1."""
        if content not in self._number:
            self._number[content] = len(self.contents)
            self.contents.append(content)
        return self._number[content] + 1

    def _next_of(self, s: State, k: int, i: int) -> bool:
        return all((s[self.at[j]] != UNUSED) == (j < k) for j in self.terms if j != k and self.issuer[j] == i)

    def _drop(self, b: bytearray) -> None:
        """Whoever promised more, or died, writes nothing under a term that it asked for or was given."""
        for k in self.terms:
            at = self.at[k]
            if b[at] == ASKED:
                i, life = self.issuer[k], b[at + ISSUER_LIFE]
            elif b[at] == GIVEN:
                i, life = divmod(b[at + HOLDER] - 1, 2)
            else:
                continue
            if b[3 * i + LIFE] != life or b[3 * i + PROMISED] > k:
                b[at] = DROPPED
                for field in range(1, PROMISES + self.members):
                    b[at + field] = 0

    def _electors(self, s: State | bytearray, version: int) -> int:
        if not version:
            return 0
        voters, _, previous, _, _ = self._content(s, version)
        return voters | previous

    def _elects(self, s: State, version: int, v: int) -> int:
        """What others grant only forbids. Blank ones too, but from then on they know something."""
        return not s[3 * v + KNOWS] or self._electors(s, version) >> 2 * v + s[3 * v + LIFE] & 1

    def _promisers(self, s: State, k: int) -> int:
        at = self.at[k] + PROMISES
        return sum(1 << m for m in range(self.members) if s[at + m])

    def _promised(self, b: bytearray, k: int, v: int) -> None:
        member, knows = 2 * v + b[3 * v + LIFE], b[3 * v + KNOWS]
        b[3 * v + PROMISED] = k
        if not knows:
            b[self.at[k] + BLANK_PROMISES] |= 1 << member
        elif not b[self.at[k] + PROMISES + member]:
            b[self.at[k] + PROMISES + member] = knows if self.blanks else 1
        self._drop(b)

    def _granted(self, b: bytearray, k: int, version: int, v: int, grants: int) -> None:
        b[3 * v + PROMISED], b[3 * v + KNOWS] = k, version
        if self._electors(b, version) >> 2 * v + b[3 * v + LIFE] & 1:
            b[grants] |= 1 << 2 * v + b[3 * v + LIFE]
        self._drop(b)

    def _lead(self, b: bytearray, k: int, leader: int, content: Content) -> str | None:
        """(k, 0) is written and its writer's own voter grants it; what led there is read no more."""
        at = self.at[k]
        slot = at + PROMISES + self.members
        assert not b[slot], "I5: a version is written once"
        b[at], b[at + HOLDER] = LED, 2 * leader + b[3 * leader + LIFE] + 1
        b[at + ISSUER_LIFE] = b[at + GIVEN_VERSION] = b[at + GIVEN_GRANTS] = b[at + BLANK_PROMISES] = 0
        for m in range(self.members):
            b[at + PROMISES + m] = 0
        b[slot] = self._intern(content)
        self._granted(b, k, self._version(k, 0), leader, slot + 1)
        return self._one(b)

    def _newest(self, s: State | bytearray, k: int) -> int:
        slot = self.at[k] + PROMISES + self.members
        return max(seq for seq in range(SEQS) if s[slot + 2 * seq])

    def _leads(self, s: State, k: int) -> tuple[int, int] | None:
        """Who leads under k, and the seq of its newest version, if a quorum has granted that."""
        leader, life = divmod(s[self.at[k] + HOLDER] - 1, 2)
        seq = self._newest(s, k)
        version = self._version(k, seq)
        if (s[3 * leader + LIFE], s[3 * leader + KNOWS]) != (life, version) or s[3 * leader + PROMISED] > k:
            return None
        grants = s[self.at[k] + PROMISES + self.members + 2 * seq + 1]
        return (leader, seq) if is_quorum(self._content(s, version), grants) else None

    # --- invariants ----------------------------------------------------------------------------------------------

    def _i6(self, s: State, k: int, seq: int, content: Content) -> str | None:
        """A settled config follows a joint one that quorums of both sets have granted."""
        if content[2] or self.mutant == "no_joint":
            return None
        before = self._content(s, self._version(k, seq - 1))
        grants = s[self.at[k] + PROMISES + self.members + 2 * (seq - 1) + 1]
        if before[2] and before[:2] == content[:2] and is_quorum(before, grants):
            return None
        return f"I6: ({k},{seq}) settles what was not joint or not granted by quorums of both"

    def _one(self, s: State | bytearray) -> str | None:
        """A lower term may still get its quorum although a higher one has had its own."""
        granted = 0
        for k in self.terms[::-1]:
            if s[self.at[k]] != LED:
                continue
            if granted and self._may_go_on(s, k):
                return f"two registers: term {granted} was granted by a quorum, and term {k} may still be"
            leader, life = divmod(s[self.at[k] + HOLDER] - 1, 2)
            if not granted and (self.lasting or s[3 * leader + LIFE] == life):
                slot = self.at[k] + PROMISES + self.members
                for seq in range(SEQS):
                    if s[slot + 2 * seq] and is_quorum(self._content(s, self._version(k, seq)), s[slot + 2 * seq + 1]):
                        granted = k
        return None

    def _may_go_on(self, s: State | bytearray, k: int) -> bool:
        leader, life = divmod(s[self.at[k] + HOLDER] - 1, 2)
        if s[3 * leader + LIFE] != life or s[3 * leader + PROMISED] > k:
            return False
        version = self._version(k, self._newest(s, k))
        willing = sum(
            1 << 2 * v + s[3 * v + LIFE] for v in self.ids if s[3 * v + PROMISED] <= k and s[3 * v + KNOWS] <= version
        )
        return is_quorum(self._content(s, version), willing)
