"""Checkers of the invariants I12-I15 of protocol/README.md: processes and gateways do what they have said.

They see a broken rule at the moment it is broken, long before it costs a lease or a command. Their facts are those of
simulations, in true time to the microsecond; a recording is not checked by them.
"""

from __future__ import annotations

from lfa.deploy.analysis.verification.checker import EARLY_S, LONG_AGO, Checker, shown
from lfa.protocol.lease.membership import ids
from lfa.protocol.lease.term_window import LAST
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import (
    Config,
    Grant,
    LeaseBody,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Term,
    Version,
)
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.names import WITNESS_ID


class LeaseEnd(Checker):
    """Checker of I12: who leads no more says so at once, asks for the term no more, and only then releases it."""

    name = "I12"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._lease: dict[Member, tuple[Term, float]] = {}
        self._holder: dict[Term, Member] = {}

    def leads(self, at: float, who: Member, term: Term, until: float) -> None:
        self._judge(at, who, f"leads {shown(term)}")
        self._lease[who] = (term, until)

    def leads_no_more(self, at: float, who: Member) -> None:
        self._lease.pop(who, None)

    def adopts(self, at: float, who: Member, config: Config) -> None:
        self._judge(at, who, "adopts a config")

    def proposes(self, at: float, who: Member, propose: Propose) -> None:
        self._holder[propose.term] = propose.holder
        self._judge(at, who, f"proposes {shown(propose.term)}")

    def releases(self, at: float, term: Term) -> None:
        who = self._holder.get(term)
        if who is not None and who in self._lease and self._lease[who][0] <= term:
            self.broken(at, f"{shown(who)} released {shown(term)} and has not stepped down")

    def over(self, at: float) -> None:
        for who in list(self._lease):
            self._judge(at - self.timing.heartbeat_s, who, "runs on")

    def _judge(self, at: float, who: Member, action: str) -> None:
        """Check that the lease of `who`, who acts, has not ended without a word."""
        term, until = self._lease.get(who, (Term(), at))
        if until < at - EARLY_S:
            self.broken(at, f"{shown(who)} {action}, and its lease of {shown(term)} ended at {until:.4f} s")
            del self._lease[who]


class GatewayWord(Checker):
    """Checker of I13: a gateway obeys nothing while it is shut, nothing from the future, nothing below a term that it
    has confirmed to refuse, no term that is out of reach, and no leader under one that no quorum has granted it yet.
    """

    name = "I13"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._shut_until: dict[int, float] = {}
        self._least: dict[int, Term] = {}
        self._granted: set[Term] = set()

    def gateway_starts(self, at: float, robot_id: int, shut_until: float) -> None:
        self._shut_until[robot_id] = shut_until
        self._least.pop(robot_id, None)

    def bars(self, at: float, robot_id: int, below: Term) -> None:
        self._least[robot_id] = max(self._least.get(robot_id, below), below)

    def leads(self, at: float, who: Member, term: Term, until: float) -> None:
        self._granted.add(term)

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        wrong = [
            text
            for text, is_so in (
                ("while it is shut", at < self._shut_until.get(robot_id, LONG_AGO) - EARLY_S),
                (f"of a time {-age * 1000:.1f} ms ahead", age < -EARLY_S),
                ("that it had said to refuse", cmd.term < self._least.get(robot_id, cmd.term)),
                ("that no message can carry", cmd.term.n > LAST),
                ("that no quorum has granted", cmd.as_leader and cmd.term not in self._granted),
            )
            if is_so
        ]
        if wrong:
            self.broken(at, f"gateway {robot_id} obeyed a command of {shown(cmd.term)} {', '.join(wrong)}")


class VoterWord(Checker):
    """Checker of I14: a refusal raises no promise; who has heard a RELEASE neither grants nor promises up to that term,
    and names it when it refuses; and who starts anew asks for higher terms than before, unless a wall clock steps.
    """

    name = "I14"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._released: dict[Member, Term] = {}
        self._given: dict[Member, Term] = {}
        """Highest term that each process has asked for, promised, granted or heard a RELEASE of, or that its first
        refusal named: nothing else raises a promise but the own gateway (E24)."""
        self._barred: dict[int, Term] = {}
        self._asked: dict[int, tuple[int, Member]] = {}
        """Highest number of a term that each id has asked for, and its incarnation then."""
        self._wall_stepped = False

    def wall_steps(self, at: float, host: int) -> None:
        self._wall_stepped = True

    def bars(self, at: float, robot_id: int, below: Term) -> None:
        self._barred[robot_id] = max(self._barred.get(robot_id, below), below)

    def hears_release(self, at: float, who: Member, term: Term) -> None:
        self._released[who] = max(self._released.get(who, term), term)
        self._gives(who, term)

    def proposes(self, at: float, who: Member, propose: Propose) -> None:
        for voter in (who, propose.holder):  # the own grant of whom a term is handed over to is not said
            self._gives(voter, propose.term)

    def grants(self, at: float, voter: Member, grant: Grant, until: float) -> None:
        self._judge(at, voter, grant.term, "granted")

    def says(self, at: float, who: Member, body: LeaseBody) -> None:
        match body:
            case Promise(term):
                self._judge(at, who, term, "promised")
            case Prepare(term):
                self._asks(at, who, term)
            case Nack() if body.agreement is None:
                self._refuses(at, who, body.promised)

    def _asks(self, at: float, who: Member, term: Term) -> None:
        number, asker = self._asked.get(who.id, (-1, who))
        if asker != who and term.n <= number and not self._wall_stepped:
            self.broken(at, f"{shown(who)} asks for {shown(term)}, and {shown(asker)} had come to term {number}")
        self._asked[who.id] = max((number, asker), (term.n, who))
        self._gives(who, term)

    def _refuses(self, at: float, who: Member, promised: Term) -> None:
        released = self._released.get(who, promised)
        if promised < released:
            self.broken(
                at, f"{shown(who)} refuses by {shown(promised)}, and has heard the RELEASE of {shown(released)}"
            )
        known = max(self._given.get(who, promised), self._barred.get(who.id, Term()))
        if promised > known and promised.issuer != WITNESS_ID:  # which is the floor of an incarnation (E1)
            self.broken(at, f"{shown(who)} refuses by {shown(promised)}, and has given nothing above {shown(known)}")
        self._gives(who, promised)

    def _judge(self, at: float, voter: Member, term: Term, action: str) -> None:
        released = self._released.get(voter)
        if released is not None and term <= released:
            self.broken(at, f"{shown(voter)} {action} {shown(term)} after the RELEASE of {shown(released)}")
        self._gives(voter, term)

    def _gives(self, who: Member, term: Term) -> None:
        self._given[who] = max(self._given.get(who, term), term)


class ChainOrder(Checker):
    """Checker of I15: behind a new leader the chain is in the order of the newest config that a voter told it of."""

    name = "I15"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._told: dict[Term, Config] = {}
        self._own: dict[Member, Config] = {}

    def adopts(self, at: float, who: Member, config: Config) -> None:
        written_now = config.version.seq == 0 and config.chain[:1] == (who,)  # and proposed next
        if not written_now:
            self._own[who] = config

    def promises(self, at: float, who: Member, promise: Promise) -> None:
        known = self._told.get(promise.term)
        if known is None or known.version < promise.config.version:
            self._told[promise.term] = promise.config

    def proposes(self, at: float, who: Member, propose: Propose) -> None:
        told, config = self._told.get(propose.term), propose.config
        if told is None or propose.round != 0 or config.version != Version(propose.term, 0):
            return
        own = self._own.get(who)
        base = told if own is None or own.version < told.version else own
        before, after = ids(base.chain)[1:], ids(config.chain)[1:]
        kept = [i for i in before if i in after]
        if kept != [i for i in after if i in before]:
            self.broken(at, f"{shown(who)} wrote the chain {list(ids(config.chain))} after {list(ids(base.chain))}")


WORDS_KEPT: tuple[type[Checker], ...] = (LeaseEnd, GatewayWord, VoterWord, ChainOrder)
"""Checkers of I12-I15."""
