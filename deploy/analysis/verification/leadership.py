"""Checkers of the invariants L5-L7 of protocol/README.md: who leads after whom, and for how long.

L5 is for runs without faults, L6 for a crash of the leader and no other fault, L7 for any run.
"""

from __future__ import annotations

from collections.abc import Set

from lfa.deploy.analysis.verification.checker import EARLY_S, LONG_AGO, Checker, shown
from lfa.protocol.lease.quorum import electors, is_quorum, quorum_time
from lfa.protocol.lease.timing import CLOCK_RATE_ERROR, Timing
from lfa.protocol.messages.consensus import Config, Member, Term
from lfa.protocol.messages.robot import CmdVel


class Steady(Checker):
    """Checker of L5: without faults the leader does not change, and nobody leaves its chain."""

    name = "L5"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._holder: Member | None = None
        self._chain: set[Member] = set()

    def adopts(self, at: float, who: Member, config: Config) -> None:
        if config.chain[0] != who:
            return
        lost = sorted(shown(member) for member in self._chain - set(config.chain))
        if lost:
            self.broken(at, f"{shown(who)} closed the chain over {', '.join(lost)}, and nothing happened to them")
        self._chain = set(config.chain)

    def leads(self, at: float, who: Member, term: Term, until: float) -> None:
        if self._holder is None:
            self._holder = who
        elif self._holder != who:
            self.broken(at, f"{shown(who)} leads after {shown(self._holder)}, and nothing happened to that one")
            self._holder = who

    def leads_no_more(self, at: float, who: Member) -> None:
        if who == self._holder:
            self.broken(at, f"{shown(who)} stopped leading, and nothing happened to it")


class NextInChain(Checker):
    """Checker of L6: after a crash of the leader the next robot in the chain leads."""

    name = "L6"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._alive: set[Member] = set()
        self._config: dict[Member, Config] = {}
        self._leader: Member | None = None
        self._expected: Member | None = None

    def lives(self, at: float, who: Member) -> None:
        self._alive.add(who)

    def adopts(self, at: float, who: Member, config: Config) -> None:
        self._config[who] = config

    def leads(self, at: float, who: Member, term: Term, until: float) -> None:
        if self._expected is not None and who != self._expected:
            self.broken(at, f"{shown(who)} leads, next in the chain was {shown(self._expected)}")
        self._leader, self._expected = who, None

    def ends(self, at: float, who: Member) -> None:
        """Record the end of a process; after a leader's end its successor must lead, unless no quorum is left."""
        self._alive.discard(who)
        config = self._config.get(who)
        if who == self._leader and config is not None and is_quorum(config, self._alive):
            self._expected = next(iter(config.chain[1:]), None)


class StopsWithoutQuorum(Checker):
    """Checker of L7: a leader that cannot reach a quorum stops acting in time."""

    name = "L7"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._alive: set[Member] = set()
        self._cuts: Set[tuple[int, int]] = frozenset()
        self._config: dict[int, Config] = {}
        self._open: dict[tuple[int, int], float] = {}
        """Time [s] at which each cut link was last open."""
        self._ended: dict[Member, float] = {}
        self._given: dict[tuple[int, Term], float] = {}
        """Time [s] at which each robot first acted under a term that was handed over to it."""
        self._before: dict[int, float] = {}
        """Time [s] at which each robot last reached a quorum of its previous config."""

    def lives(self, at: float, who: Member) -> None:
        self._alive.add(who)

    def ends(self, at: float, who: Member) -> None:
        self._alive.discard(who)
        self._ended.setdefault(who, at)

    def parts(self, at: float, cuts: Set[tuple[int, int]]) -> None:
        for link in cuts - self._cuts:
            self._open[link] = at
        self._cuts = frozenset(cuts)

    def adopts(self, at: float, who: Member, config: Config) -> None:
        self._before[who.id] = self._since(at, who.id)
        self._config[who.id] = config

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        if not cmd.as_leader or robot_id not in self._config:
            return
        longest_s = (self.timing.act_s + self.timing.deadman_s) / (1.0 - CLOCK_RATE_ERROR) + EARLY_S
        since = self._since(at, robot_id)
        if cmd.term.issuer != robot_id:
            # A lease that was handed over needs no path to the voters: its start time was sent to the issuer before.
            since = max(since, self._given.setdefault((robot_id, cmd.term), at))
        if at - since > longest_s:
            late = f"{(at - since) * 1000.0:.1f} ms without a quorum"
            self.broken(at, f"gateway {robot_id} obeyed {shown(cmd.term)}, {late}")

    def _since(self, at: float, robot_id: int) -> float:
        """Return the time [s] at which a robot last reached a quorum of its config.

        A quorum of the previous config counts for the time that the robot had it: a lease outlives the config that it
        was granted under.
        """
        config = self._config.get(robot_id)
        before = self._before.get(robot_id, LONG_AGO)
        if config is None:
            return before
        now = quorum_time(config, {m: self._reached(at, robot_id, m) for m in electors(config)})
        return before if now is None else max(before, now)

    def _reached(self, at: float, robot_id: int, voter: Member) -> float:
        """Return the time [s] at which `voter` could last be reached and could last answer."""
        there, back = (robot_id, voter.id), (voter.id, robot_id)
        asked = self._open.get(there, LONG_AGO) if there in self._cuts else at
        answered = self._open.get(back, LONG_AGO) if back in self._cuts else at
        lived = at if voter in self._alive else self._ended.get(voter, LONG_AGO)
        return min(asked, answered, lived)
