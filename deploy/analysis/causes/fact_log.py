"""Log of what the checkers of a schedule hear: who said and did what, when; the rule of a violation is found in it."""

from __future__ import annotations

from collections import defaultdict

from msgspec import Struct

from lfa.deploy.analysis.verification.checker import LONG_AGO, Checker, Violation
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import (
    Config,
    Grant,
    LeaseBody,
    Member,
    Prepare,
    Promise,
    Propose,
    Superseded,
    Term,
)
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.names import WITNESS_ID, robot_id_of


class CauseStep(Struct, frozen=True):
    """One step of the chain, at true time `at_s` [s]."""

    at_s: float
    text: str


class BrokenRule(Struct, frozen=True):
    """The rules that a violation shows to be broken, and the steps that lead there, the violation last."""

    rules: tuple[str, ...]
    """Numbers in protocol/README.md, the root first; of two, the second is what the first was to keep."""
    steps: tuple[CauseStep, ...]


class Asked(Struct, frozen=True):
    """PREPARE of `who` under `term`, with the config that it knew then; None: none."""

    at_s: float
    who: Member
    term: Term
    known: Config | None


class LeaseSpan(Struct, frozen=True):
    """Lease that `who` took for valid at `at_s` until `until_s` [s, true time]."""

    at_s: float
    who: Member
    term: Term
    until_s: float


class ClockReading(Struct, frozen=True):
    """A process's clock as its command told it: true time and time by that clock [s]."""

    at_s: float
    local_s: float


class FactLog(Checker):
    """All facts of the leases of one schedule, in the order in which they were observed."""

    name = "log"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self.named: tuple[int, ...] = ()
        """Robots that the mission names."""
        self.began: dict[Member, float] = {}
        self.ended: dict[Member, float] = {}
        self.healed_s = LONG_AGO
        self.leases: list[LeaseSpan] = []
        self.proposed: dict[Term, list[tuple[float, Member, Propose]]] = defaultdict(list)
        self.granted: dict[Term, list[tuple[float, Member, int]]] = defaultdict(list)
        """Grants of each term: time [s], voter, round."""
        self.promised: dict[Term, list[tuple[float, Member]]] = defaultdict(list)
        """Promises that reached their candidate."""
        self.asked: list[Asked] = []
        self.called_superseded: list[tuple[float, Member, int]] = []
        """Who told an incarnation that there is a later one, and the number of that one."""
        self.met: dict[Member, dict[Member, float]] = defaultdict(dict)
        """Time [s] of the first message of each other incarnation that a process was given."""
        self.agreed: dict[Member, int] = {}
        """Digest of what each process holds to be agreed; of one that speaks another version it tells nothing."""
        self.configs: dict[Member, tuple[float, Config]] = {}
        """Newest config of each process."""
        self.strangers: list[tuple[float, Member, Member]] = []
        """Time [s] at which a process took a config with a robot in its chain that nobody has admitted; the robot."""
        self.heard_s: dict[Member, float] = {}
        """Time [s] of the last word of each process."""
        self.first_readings: dict[Member, ClockReading] = {}
        self.last_readings: dict[Member, ClockReading] = {}
        self.barred: dict[int, tuple[float, Term]] = {}
        """Highest term up to which each robot's gateway refuses, and since when [s]."""
        self.wall_steps_s: dict[int, float] = {}
        """Time [s] of the last step of each host's wall clock."""

    @property
    def living(self) -> list[Member]:
        return sorted(member for member in self.began if member not in self.ended)

    @property
    def newest(self) -> Config | None:
        """Newest config that a living process knows."""
        known = [self.configs[member][1] for member in self.living if member in self.configs]
        return max(known, key=lambda config: config.version, default=None)

    # --- facts -------------------------------------------------------------------------------------------------

    def names(self, at: float, robots: tuple[int, ...]) -> None:
        self.named = robots

    def lives(self, at: float, who: Member) -> None:
        self.began[who] = self.heard_s[who] = at
        self.ended.pop(who, None)

    def holds(self, at: float, who: Member, agreed: int) -> None:
        self.agreed[who] = agreed

    def speaks(self, at: float, who: Member) -> None:
        self.agreed.pop(who, None)

    def meets(self, at: float, who: Member, other: Member) -> None:
        self.met[who][other] = at

    def ends(self, at: float, who: Member) -> None:
        self.ended.setdefault(who, at)

    def heals(self, at: float, step_s: float) -> None:
        self.healed_s = at

    def wall_steps(self, at: float, host: int) -> None:
        self.wall_steps_s[host] = at

    def leads(self, at: float, who: Member, term: Term, until: float) -> None:
        self.leases.append(LeaseSpan(at, who, term, until))

    def adopts(self, at: float, who: Member, config: Config) -> None:
        self.configs[who] = at, config
        admitted = {*self.named, *(spare.id for spare in config.roster.spares)}
        self.strangers += [(at, who, member) for member in config.chain if member.id not in admitted]

    def promises(self, at: float, who: Member, promise: Promise) -> None:
        self.promised[promise.term].append((at, who))
        self.heard_s[who] = at

    def proposes(self, at: float, who: Member, propose: Propose) -> None:
        self.proposed[propose.term].append((at, who, propose))
        self.heard_s[who] = at

    def grants(self, at: float, voter: Member, grant: Grant, until: float) -> None:
        self.granted[grant.term].append((at, voter, grant.round))
        self.heard_s[voter] = at

    def says(self, at: float, who: Member, body: LeaseBody) -> None:
        self.heard_s[who] = at
        match body:
            case Prepare(term):
                known = self.configs.get(who)
                self.asked.append(Asked(at, who, term, None if known is None else known[1]))
            case Superseded(newest):
                self.called_superseded.append((at, who, newest))

    def bars(self, at: float, robot_id: int, below: Term) -> None:
        if robot_id not in self.barred or self.barred[robot_id][1] < below:
            self.barred[robot_id] = at, below

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        who = Member(robot_id_of(cmd.header.sender) or WITNESS_ID, cmd.header.incarnation)
        reading = ClockReading(at, cmd.header.stamp)
        self.first_readings.setdefault(who, reading)
        self.last_readings[who] = reading
        self.heard_s[who] = at


def chain(violation: Violation, rules: str, *steps: CauseStep) -> BrokenRule:
    """Return the chain of a violation of `rules`, such as `E15 E3`: its steps by time, then the violation."""
    by_time = sorted(steps, key=lambda step: step.at_s)
    return BrokenRule(tuple(rules.split()), (*by_time, CauseStep(violation.at, f"{violation.name}: {violation.text}")))


def called(member: Member) -> str:
    """Return a process's name in a sentence."""
    return "the witness" if member.id == WITNESS_ID else f"robot {member.id}"
