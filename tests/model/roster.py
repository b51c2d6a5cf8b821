"""Rosters as a model on the project's own functions: which configs a leader may write while robots come and go (I11).

The mission names robots 1 and 2 and the witness; robot 3 is a spare. At each step one of them may be silent, so that
silence is no part of a state. Operators let any robot join, at the tail or in a place, and retire. The leader writes
what `reshaped` says, and a robot that may lead takes over from what was written last, whether quorums have accepted it
or not. When everybody that the mission names is there, all may also have lost their votes, and start anew (E18).

Checked for every config: I11 by its checker, and MISSION: no quorum is made of spares alone (E33).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import msgspec
from msgspec import Struct, structs

from lfa.deploy.analysis.verification.safety import RosterHolds
from lfa.protocol.errors import Refused
from lfa.protocol.lease.election import Election
from lfa.protocol.lease.failure_detector import FailureDetector
from lfa.protocol.lease.membership import chosen, is_spare, joined, led_by, retired, unanimous_config
from lfa.protocol.lease.quorum import is_quorum
from lfa.protocol.lease.reconfiguration import Policy, reshaped
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import Config, Electorate, Member, Roster, Term, Version
from lfa.protocol.mission import Leading, Mission
from tests.model.checker import State, Step, Successor

MISSION = Mission(robots=(1, 2), witness=True, leading=Leading(route_m=((1.0, 0.0),)))
MEMBERS = tuple(Member(i, 1) for i in (0, 1, 2, 3))
NAMED = MEMBERS[:3]
TERM, TIMING = Term(1, 1, 1), timing_of("std")
Here = tuple[Member, ...]
"""Members that are not silent at a step."""
PRESENT: tuple[Here, ...] = tuple(c for n in (3, 4) for c in combinations(MEMBERS, n))
WRITTEN = Version(TERM, 0)

MUTANTS = {
    "spares_vote": "spares vote like others",
    "retired_returns": "a retired robot is taken in again",
    "retired_leads": "a retired robot stands for election",
    "full_house_of_all": "a unanimous start puts every robot that answers into the chain",
}


class Written(Struct, frozen=True, array_like=True):
    """The newest config, whether quorums have accepted it, and how many calls operators may still give."""

    config: Config
    accepted: bool
    calls: int


class _Holder:
    """A held term as `reshaped` reads it: who is silent, who said HELLO, and whether the config is accepted."""

    def __init__(self, accepted: bool, here: Here, said_hello: Here) -> None:
        self._accepted, self._here, self.said_hello = accepted, here, said_hello

    def silent(self, member: Member, _now: float, _silence_s: float) -> bool:
        return member not in self._here

    def committed(self, _config: Config) -> bool:
        return self._accepted


class RosterModel:
    columns = ("the team",)

    def __init__(self, calls: int, mutant: str = "") -> None:
        """`calls`: joins and retirements that a leader carries out, in all."""
        assert mutant in ("", *MUTANTS), mutant
        self.calls, self.mutant = calls, mutant
        self._decoder = msgspec.msgpack.Decoder(Written)
        self._peers = FailureDetector(MEMBERS[1], TIMING.heartbeat_s)
        self._policy = Policy(MISSION.tiebreak, MISSION.shrink, MISSION.robots, MISSION.witness)
        self._election = Election(MEMBERS[1], MISSION, TIMING, 0.0)

    def initial(self) -> State:
        """The mission's team, whose first config is accepted; the spare is there."""
        config = Config(WRITTEN, (MEMBERS[0], *MEMBERS[1:3]), MEMBERS[0], None, MEMBERS[1:3])
        return msgspec.msgpack.encode(Written(config, True, self.calls))

    def step(self, event: tuple[object, ...]) -> Step:
        return Step(0, str(event[0]))

    def successors(self, state: State) -> list[Successor]:
        s = self._decoder.decode(state)
        out = list(self._start_anew(s))
        for here in PRESENT:
            if is_quorum(s.config, here):
                out += self._take_over(s, here)
                if not s.accepted:
                    out.append(self._after("quorums accept it", structs.replace(s, accepted=True)))
            if s.config.chain[0] in here:
                out += self._reshape(s, here)
        if s.calls:
            out += self._operators(structs.replace(s, calls=s.calls - 1))
        return list({(after, wrong): (text, after, wrong) for text, after, wrong in out}.values())

    # --- what happens --------------------------------------------------------------------------------------------

    def _take_over(self, s: Written, here: Here) -> Iterator[Successor]:
        """A robot that may lead stands and wins, or is handed the lease."""
        for member in here:
            may = self._election.may_lead(s.config, member.id) or self.mutant == "retired_leads"
            if may and member.id and member != s.config.chain[0]:
                for keeps in (False, True):
                    config = led_by(s.config, member, TERM, lambda other: other not in here, keep_leader=keeps)
                    yield self._written(f"{member.id} leads, {_ids(here)} are there", s, config)

    def _start_anew(self, s: Written) -> Iterator[Successor]:
        for leader in NAMED[1:]:
            if not self._election.may_lead(s.config, leader.id):
                continue
            spares = [m for m in MEMBERS if is_spare(s.config.roster, m.id)]
            config = unanimous_config(s.config, leader, TERM, (*NAMED[1:], NAMED[0], *spares))
            if self.mutant == "full_house_of_all":
                everybody = (leader, *(m for m in (*NAMED[1:], *spares) if m != leader))
                config = structs.replace(config, chain=everybody)
            yield self._written(f"unanimous start with {leader.id}", s, config)

    def _reshape(self, s: Written, here: Here) -> Iterator[Successor]:
        for asks in (None, *(member for member in here if member not in s.config.chain)):
            if asks is None or self._election.takes_in(s.config, asks.id) or self.mutant == "retired_returns":
                text = "" if asks is None else f", HELLO of {asks.id}"
                hello = () if asks is None else (asks,)
                yield self._rewritten(f"{_ids(here)} are there{text}", s, s.config.roster, here, hello)

    def _operators(self, s: Written) -> Iterator[Successor]:
        """Calls that the leader carries out; who leads is not retired, but hands over first (E34)."""
        roster, chain = s.config.roster, tuple(m.id for m in s.config.chain)
        for member in MEMBERS[1:]:
            for slot in (0, *MISSION.robots):
                try:
                    newer = joined(roster, MISSION.robots, chain, member.id, slot)
                except Refused:
                    continue
                yield self._rewritten(f"join {member.id} for {slot}", s, newer, MEMBERS, ())
            if member != s.config.chain[0]:
                try:
                    newer = retired(roster, MISSION.robots, chain, member.id)
                except Refused:
                    continue
                newer = structs.replace(newer, retired=tuple(sorted(newer.retired)))
                yield self._rewritten(f"retire {member.id}", s, newer, MEMBERS, ())

    def _rewritten(self, text: str, s: Written, roster: Roster, here: Here, hello: Here) -> Successor:
        """The next config by the project's `reshaped`."""
        known = Roster(roster.spares) if self.mutant == "retired_returns" and hello else roster
        holder = _Holder(s.accepted, here, hello)
        config = reshaped(
            s.config, holder, s.config.chain[0], self._peers, frozenset(), self._policy, TIMING, 0.0, known  # type: ignore[arg-type]
        )  # fmt: skip
        config = structs.replace(config, roster=roster)
        if self.mutant == "spares_vote" and s.accepted and s.config.previous is None:
            voters = chosen(config.voters, config.chain, None, Roster())
            if set(voters) != set(s.config.voters):
                config = structs.replace(config, voters=voters, previous=Electorate(s.config.voters, s.config.tie))
        return self._written(text, s, config)

    # --- states --------------------------------------------------------------------------------------------------

    def _written(self, text: str, s: Written, config: Config) -> Successor:
        """A version only grows, and the order of voters means nothing: neither makes another state."""
        before = config.previous
        if before is not None:
            before = structs.replace(before, voters=tuple(sorted(before.voters)))
        config = structs.replace(config, version=WRITTEN, voters=tuple(sorted(config.voters)), previous=before)
        return self._after(text, Written(config, s.accepted and config == s.config, s.calls))

    def _after(self, text: str, s: Written) -> Successor:
        checker = RosterHolds(TIMING)
        checker.adopts(0.0, s.config.chain[0], s.config)
        wrong = f"I11: {checker.violations[0].text}" if checker.violations else None
        spares = [voter for voter in s.config.voters if is_spare(s.config.roster, voter.id)]
        if wrong is None and spares and is_quorum(s.config, spares):
            wrong = f"MISSION: spares {_ids(tuple(spares))} are a quorum"
        return (text,), msgspec.msgpack.encode(s), wrong


def _ids(members: Here) -> list[int]:
    return [member.id for member in members]
