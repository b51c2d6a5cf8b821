"""Checkers of the invariants I1-I8 of protocol/README.md, by outside observation.

L1-L4 are in `liveness.py`, L5-L7 in `leadership.py`.
"""

from __future__ import annotations

from collections.abc import Iterable

from lfa.deploy.analysis.verification.checker import EARLY_S, LONG_AGO, Checker, WithFences, shown
from lfa.deploy.analysis.verification.fleet_stop import StopHolds
from lfa.protocol.lease.membership import is_spare
from lfa.protocol.lease.quorum import is_quorum
from lfa.protocol.lease.timing import CLOCK_RATE_ERROR, Timing
from lfa.protocol.messages.consensus import Config, Electorate, Grant, Member, Promise, Propose, Term, Version
from lfa.protocol.messages.robot import CmdVel


class LeaseExclusivity(WithFences):
    """Checker of I1: leases of different holders are never valid together, unless the lower term is fenced."""

    name = "I1"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._valid: dict[Member, tuple[Term, float]] = {}

    def leads(self, at: float, who: Member, term: Term, until: float) -> None:
        self._valid[who] = (term, until)
        for other, (its_term, its_until) in list(self._valid.items()):
            if other == who:
                continue
            if its_until <= at + EARLY_S:
                del self._valid[other]
                continue
            lower, holder, end = min((term, who, until), (its_term, other, its_until))
            if not self.fences.refuses(holder.id, lower, end):
                self.broken(
                    at,
                    f"{shown(term)} of {shown(who)} and {shown(its_term)} of {shown(other)} are valid together",
                )

    def leads_no_more(self, at: float, who: Member) -> None:
        self._valid.pop(who, None)


class Acting(Checker):
    """Checker of I2: accepted commands are fresh, a term has one holder, and leader terms never decrease."""

    name = "I2"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._highest = Term()
        self._of_gateway: dict[int, Term] = {}
        self._holder: dict[Term, int] = {}
        self._with_state: set[Member] = set()
        self._wall_stepped = False

    def gateway_starts(self, at: float, robot_id: int, shut_until: float) -> None:
        self._of_gateway.pop(robot_id, None)

    def wall_steps(self, at: float, host: int) -> None:
        self._wall_stepped = True

    def adopts(self, at: float, who: Member, config: Config) -> None:
        self._with_state.add(who)

    def ends(self, at: float, who: Member) -> None:
        """Record the end of a process; once no process remembers a term, only the wall clocks keep the order (E1)."""
        self._with_state.discard(who)
        if self._wall_stepped and not self._with_state:
            self._highest = Term()

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        if cmd.term < self._of_gateway.get(robot_id, cmd.term):
            self.broken(at, f"gateway {robot_id} obeyed {shown(cmd.term)} after {shown(self._of_gateway[robot_id])}")
        self._of_gateway[robot_id] = cmd.term
        if age > self.timing.deadman_s + EARLY_S:
            self.broken(at, f"gateway {robot_id} obeyed a command {age * 1000:.1f} ms old")
        if self._holder.setdefault(cmd.term, cmd.holder) != cmd.holder:
            self.broken(at, f"{shown(cmd.term)} obeyed for {cmd.holder} and for {self._holder[cmd.term]}")
        if not cmd.as_leader:
            return
        if cmd.holder != robot_id:
            self.broken(at, f"gateway {robot_id} obeyed a leader command of {cmd.holder}")
        if cmd.term < self._highest:
            self.broken(at, f"leader command of {shown(cmd.term)} obeyed after one of {shown(self._highest)}")
        self._highest = max(self._highest, cmd.term)


class OneHolder(Checker):
    """Checker of I3: each term has one holder, and only its holder or its issuer proposes it."""

    name = "I3"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._holder: dict[Term, Member] = {}

    def proposes(self, at: float, who: Member, propose: Propose) -> None:
        known = self._holder.setdefault(propose.term, propose.holder)
        if known != propose.holder:
            self.broken(at, f"{shown(propose.term)} held by {shown(known)} and by {shown(propose.holder)}")
        if who != propose.holder and (who.id, who.incarnation) != (propose.term.issuer, propose.term.incarnation):
            self.broken(at, f"{shown(propose.term)} proposed by {shown(who)}")


class OneBond(WithFences):
    """Checker of I4: a bound voter grants to another holder only after expiry, release, hand-over or a fence.

    A bond lasts as long as the longest of its holder's rounds asked for (E36).
    """

    name = "I4"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._bond: dict[Member, tuple[Term, Member, float]] = {}
        self._released: set[Term] = set()
        self._holder: dict[Term, Member] = {}
        self._gifts: set[tuple[Member, Member]] = set()
        self._shorter_s: dict[tuple[Term, int], float] = {}
        """How much shorter [s] than by `T_grant` a round asks its voters to be bound, on any clock."""

    def proposes(self, at: float, who: Member, propose: Propose) -> None:
        self._holder[propose.term] = propose.holder
        if propose.grant_ms:
            shorter_s = self.timing.grant_s - propose.grant_ms / 1000.0
            self._shorter_s[propose.term, propose.round] = shorter_s / (1.0 - CLOCK_RATE_ERROR)
        if propose.holder != who:
            self._gifts.add((who, propose.holder))

    def releases(self, at: float, term: Term) -> None:
        self._released.add(term)

    def grants(self, at: float, voter: Member, grant: Grant, until: float) -> None:
        holder = self._holder[grant.term]
        term, other, its_until = self._bond.get(voter, (grant.term, holder, LONG_AGO))
        issued_by = (grant.term.issuer, grant.term.incarnation)
        # The receiver's own grant of a transfer proposal is not observable; it shows only in its next grant.
        handed_over = issued_by == (other.id, other.incarnation) or (other, voter) in self._gifts
        free = other == holder or its_until <= at + EARLY_S or term in self._released or handed_over
        fenced = self.fences.fenced(other.id, term) or self.fences.refuses(other.id, term, its_until)
        if not free and not fenced:
            bond = f"bound to {shown(term)} of {shown(other)}"
            self.broken(at, f"{shown(voter)} granted {shown(grant.term)} to {shown(holder)}, {bond}")
        until -= self._shorter_s.get((grant.term, grant.round), 0.0)
        self._bond[voter] = (grant.term, holder, max(until, its_until) if other == holder else until)


class OneChain(Checker):
    """Checker of I5: one config per version, versions never decrease, and a leader is first in its chain."""

    name = "I5"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._content: dict[Version, Config] = {}
        self._newest: dict[Member, Config] = {}

    def adopts(self, at: float, who: Member, config: Config) -> None:
        if self._content.setdefault(config.version, config) != config:
            self.broken(at, f"{shown(who)} has another config of version {config.version}")
        if who in self._newest and config.version <= self._newest[who].version:
            self.broken(at, f"{shown(who)} went back to version {config.version}")
        self._newest[who] = config

    def leads(self, at: float, who: Member, term: Term, until: float) -> None:
        chain = self._newest[who].chain if who in self._newest else ()
        if not chain or chain[0] != who:
            self.broken(at, f"{shown(who)} leads {shown(term)} with chain {[m.id for m in chain]}")


class JointChange(Checker):
    """Checker of I6: voters change through a joint config that quorums of both sets accept."""

    name = "I6"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._known: dict[Version, Config] = {}
        self._accepted: dict[Member, Version] = {}

    def grants(self, at: float, voter: Member, grant: Grant, until: float) -> None:
        self._accepted[voter] = max(grant.version, self._accepted.get(voter, grant.version))

    def adopts(self, at: float, who: Member, config: Config) -> None:
        if config.version in self._known:
            return
        self._known[config.version] = config
        term, seq = config.version.term, config.version.seq
        before = self._known.get(Version(term, seq - 1))
        if before is None:
            return
        if (config.voters, config.tie) != (before.voters, before.tie):
            if before.previous is not None or config.previous != Electorate(before.voters, before.tie):
                self.broken(at, f"version {shown(term)}.{seq} has other voters and is not joint with those before")
        elif config.previous != before.previous:
            accepted = {m for m, version in self._accepted.items() if version >= before.version}
            if config.previous is not None or not is_quorum(before, accepted):
                self.broken(at, f"version {shown(term)}.{seq} ends a joint config that its quorums have not accepted")


class NoAmnesiacVote(Checker):
    """Checker of I7: a new term rests on promises of a quorum that knows a config, or of all members."""

    name = "I7"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._promised: dict[Term, dict[Member, bool]] = {}
        self._named: frozenset[int] = frozenset()
        """Robots that the mission names, where that is known: a unanimous start needs them all (E18)."""

    def names(self, at: float, robots: tuple[int, ...]) -> None:
        self._named = frozenset(robots)

    def promises(self, at: float, who: Member, promise: Promise) -> None:
        self._promised.setdefault(promise.term, {})[who] = promise.blank

    def proposes(self, at: float, who: Member, propose: Propose) -> None:
        config = propose.config
        if propose.round != 0 or config.version != Version(propose.term, 0):
            return
        promised = {**self._promised.get(propose.term, {}), who: False}
        previous = config.previous
        full = previous is not None and previous.rule == "all" and self._is_full(previous.voters, promised)
        remembering = {m for m, blank in promised.items() if not blank}
        if not is_quorum(config, remembering) and not full:
            self.broken(at, f"{shown(propose.term)} proposed on promises of {sorted(shown(m) for m in promised)}")

    def _is_full(self, voters: tuple[Member, ...], promised: Iterable[Member]) -> bool:
        return set(voters) <= set(promised) and self._named <= {voter.id for voter in voters}


class Residual(WithFences):
    """Checker of I8: a new leader acts only when the previous one is fenced or has come to rest by its deadman."""

    name = "I8"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._last: tuple[float, CmdVel] | None = None

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        if not cmd.as_leader:
            return
        if self._last is not None:
            stamped_at, old = self._last
            rest_at = stamped_at + self.timing.deadman_s / (1.0 + CLOCK_RATE_ERROR) - EARLY_S
            if cmd.holder != old.holder and at < rest_at and not self.fences.refuses(old.holder, old.term, at):
                early = (rest_at - at) * 1000.0
                self.broken(
                    at,
                    f"{shown(cmd.term)} obeyed {early:.1f} ms before {shown(old.term)} of {old.holder} is at rest",
                )
        self._last = (at - age, cmd)


class OneAgreement(Checker):
    """Checker of I9: promises and grants join processes that hold the same agreement."""

    name = "I9"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._agreed: dict[Member, int] = {}
        self._holder: dict[Term, Member] = {}

    def holds(self, at: float, who: Member, agreed: int) -> None:
        self._agreed[who] = agreed

    def proposes(self, at: float, who: Member, propose: Propose) -> None:
        self._holder[propose.term] = propose.holder

    def promises(self, at: float, who: Member, promise: Promise) -> None:
        self._alike(at, who, Member(promise.term.issuer, promise.term.incarnation), "promised to")

    def grants(self, at: float, voter: Member, grant: Grant, until: float) -> None:
        if grant.term in self._holder:
            self._alike(at, voter, self._holder[grant.term], "granted to")

    def _alike(self, at: float, voter: Member, asker: Member, action: str) -> None:
        mine = self._agreed.get(voter)
        if self._agreed.get(asker, mine) != mine:
            self.broken(at, f"{shown(voter)} {action} {shown(asker)}, which holds another agreement")


class RosterHolds(Checker):
    """Checker of I11: no retired robot is in a chain, and spares are fewer than the other voters."""

    name = "I11"

    def adopts(self, at: float, who: Member, config: Config) -> None:
        out = [shown(m) for m in config.chain if m.id in config.roster.retired]
        if out:
            self.broken(at, f"retired, and in the chain of {shown(config.version.term)}.{config.version.seq}: {out}")
        spares = sum(is_spare(config.roster, voter.id) for voter in config.voters)
        if spares and 2 * spares >= len(config.voters):
            voters = [shown(voter) for voter in config.voters]
            self.broken(at, f"{spares} spares could decide alone among voters {voters}")


SAFETY: tuple[type[Checker], ...] = (
    LeaseExclusivity,
    Acting,
    OneHolder,
    OneBond,
    OneChain,
    JointChange,
    NoAmnesiacVote,
    Residual,
    OneAgreement,
    StopHolds,
    RosterHolds,
)
