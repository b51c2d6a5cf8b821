"""Memory of one process: all that its actions read and write. Nothing is kept on disk, so a restart empties it (E1)."""

from __future__ import annotations

from lfa.protocol.lease.acceptor import Acceptor
from lfa.protocol.lease.agreement import Census, agreement_of, digest
from lfa.protocol.lease.candidate import Candidate
from lfa.protocol.lease.effects import Effect, Send
from lfa.protocol.lease.election import Election
from lfa.protocol.lease.failure_detector import FailureDetector
from lfa.protocol.lease.holder import Holder
from lfa.protocol.lease.membership import first_config
from lfa.protocol.lease.reconfiguration import Calm, Policy
from lfa.protocol.lease.step_down import PendingRelease
from lfa.protocol.lease.term_window import FREE, TermWindow
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import NO_TERM, Config, Grant, LeaseBody, Member, Prepare, Term
from lfa.protocol.mission import Mission
from lfa.protocol.names import WITNESS_ID, robot_name


def gateway_of(robot_id: int) -> str:
    """Return the address of a robot's gateway in `Send.to`."""
    return f"gateway{robot_id}"


class LeaseMemory:
    """All that one process knows of leases: as voter, candidate and leader, of its peers, and what it has to send."""

    def __init__(self, me: Member, mission: Mission, timing: Timing, now: float, floor: int) -> None:
        self.me = me
        self.timing = timing
        self.config: Config = first_config(mission)
        agreement = agreement_of(mission, timing)
        self.agreed = digest(agreement)
        """Digest of what this process holds, said in PREPARE, PROPOSE and HELLO (E25)."""
        self.leader: int | None = None
        """Id of the holder of the newest term known; None once its lease has expired by this process's own clock."""
        self.leader_until = now
        self.left_out: frozenset[int] = frozenset()
        """Ids of live robots that a leader keeps out of its chain because they are stuck (E22)."""
        floor = min(floor, FREE)
        self.seen = Term(floor)
        """Highest term known."""
        self.window = TermWindow(floor)
        self.gateway_term = NO_TERM
        """Highest term that the own gateway has seen: it refuses commands under a lower one (E24)."""
        self.superseded_by: int | None = None
        """Number of an incarnation of this process that others take for a later one (E23); None if there is none."""
        self.acceptor = Acceptor(Term(floor), timing.grant_s, now)
        self.candidate: Candidate | None = None
        self.holder: Holder | None = None
        self.pending_release = PendingRelease(timing.deadman_s)
        self.election = Election(me, mission, timing, now)
        self.census = Census(agreement, me.id, self.election.all_member_ids, now)
        self.policy = Policy(mission.tiebreak, mission.shrink, mission.robots, mission.witness)
        self.calm = Calm()
        self.peers = FailureDetector(me, timing.heartbeat_s)
        self.hello_at = now
        self.hellos: dict[int, tuple[Member, float]] = {}
        """Sender and time [s] of the last HELLO heard of each id."""
        self.released = False
        self.refused_prepare: tuple[Member, Prepare] | None = None
        """Last PREPARE refused because of a bond, with its sender."""
        self.early_grants: list[tuple[Member, Grant]] = []
        """Grants of a term that this process does not know yet, with their senders."""
        self.effects: list[Effect] = []
        """What the caller has to carry out, in order; collected by the actions of one call."""
        self.elect_after(self.acceptor.silent_until)

    # --- effects -------------------------------------------------------------------------------------------------

    def send(self, to: str, body: LeaseBody) -> None:
        """Collect a message to `to`, an address as in `Send.to`."""
        self.effects.append(Send(to, body))

    def refuse(self, src: Member, term: Term, now: float) -> None:
        """Answer `src` with the voter's refusal of `term`."""
        self.send(robot_name(src.id), self.acceptor.refusal(term, self.config, now))

    def drain(self) -> list[Effect]:
        """Return the effects added since the last call, in order."""
        effects, self.effects = self.effects, []
        return effects

    # --- what several actions ask ---------------------------------------------------------------------------------

    def elect_after(self, at: float) -> None:
        """Schedule the own candidacy by rank, counted from `at` [s] (E6)."""
        if not self.pending_release.closing:
            self.election.after(at, self.config, self.peers)

    def holder_gone(self) -> bool:
        """Return True if the token of the holder that this voter was last bound to has vanished."""
        bond = self.acceptor.bond
        return bond is not None and self.peers.is_gone(bond.holder)

    def lives_on(self, lost: tuple[Member, ...]) -> bool:
        """Return True if one of `lost` is this process, or was heard in a later incarnation."""
        return any(m.id == self.me.id or self.peers.is_superseded(m) for m in lost)

    def is_out(self, now: float) -> bool:
        """Return True if bound by no grant (always so for a learner) or absent from the leader's chain (E9)."""
        if self.holder is not None:
            return False
        if self.me.id != WITNESS_ID and self.me not in self.config.chain:
            return True
        return self.me not in self.config.voters or self.acceptor.bound(now) is None
