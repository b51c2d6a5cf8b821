"""The lease of one process: leader, lease duration and chain, by the rules E1.. in protocol/README.md.

`table.py` says what is done in which state, and why; `memory.py` holds what is known. A `Lease` never reads a clock:
`now` is the process's own monotonic time [s] in every call, and must not decrease between calls.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from lfa.protocol.lease.agreement import understands
from lfa.protocol.lease.effects import Effect
from lfa.protocol.lease.failure_detector import FailureDetector
from lfa.protocol.lease.machine import resigning, voting
from lfa.protocol.lease.machine.deadlines import DEADLINES, DUES, NEVER, WAKES, expiry
from lfa.protocol.lease.machine.memory import LeaseMemory
from lfa.protocol.lease.machine.table import ACTIONS, LeaseEvent, LeaseState, refusal, state_of
from lfa.protocol.lease.membership import ids, is_first
from lfa.protocol.lease.term_window import REACH, highest
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.consensus import (
    Config,
    Fenced,
    Grant,
    Hello,
    LeaseBody,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Release,
    Role,
    Roster,
    Superseded,
    Term,
)
from lfa.protocol.mission import Mission

SOONEST = float("-inf")
EVENTS: dict[type[LeaseBody], LeaseEvent] = {
    Prepare: LeaseEvent.PREPARE,
    Promise: LeaseEvent.PROMISE,
    Propose: LeaseEvent.PROPOSE,
    Grant: LeaseEvent.GRANT,
    Release: LeaseEvent.RELEASE,
    Hello: LeaseEvent.HELLO,
    Superseded: LeaseEvent.SUPERSEDED,
    Fenced: LeaseEvent.FENCED,
}
"""Events of messages, without NACK, whose event follows from what was asked, and FENCE, which is for gateways."""

_AGREEING = (Prepare, Propose, Hello)
"""Messages that name what their sender and its team hold alike (E25)."""


class Observed(NamedTuple):
    """One event and what came of it, told to an observer before the effects are carried out."""

    event: LeaseEvent
    before: LeaseState
    after: LeaseState
    given: tuple[Any, ...]
    """The sender and the message, for the event of a message."""
    effects: list[Effect]


Observer = Callable[[Observed], object]


class Lease:
    """Voter, candidate and leader of one process; the caller carries out effects in the given order."""

    def __init__(
        self, me: Member, mission: Mission, timing: Timing, now: float, floor: int, observer: Observer | None = None
    ) -> None:
        """Start the lease of `me` (id 0: the witness, which votes and never leads).

        `floor` is the wall clock [ms] at boot (small integers in simulation): terms of this incarnation are above it.
        It orders incarnations and is no part of any safety argument. `observer` is told of every event.
        """
        self._memory = LeaseMemory(me, mission, timing, now, floor)
        self._observer = observer
        self._grant_s = timing.grant_s
        self._chain_of, self._chain = self._memory.config, ids(self._memory.config.chain)
        self._deadline_for: float | None = None
        self._deadline = NEVER
        """Last answer of `next_deadline`, and what it was asked for; None: something has happened since."""

    # --- read by the agent --------------------------------------------------------------------------------------

    @property
    def me(self) -> Member:
        return self._memory.me

    @property
    def config(self) -> Config:
        """Newest config known."""
        return self._memory.config

    @property
    def agreed(self) -> int:
        """Digest of what this process and its team hold alike (E25)."""
        return self._memory.agreed

    @property
    def grant_s(self) -> float:
        """`T_grant` [s] that this process and its team count on (E25)."""
        return self._grant_s

    @property
    def leader(self) -> int | None:
        """Id of the holder of the newest term known; None once its lease has expired by this process's own clock."""
        return self._memory.leader

    @property
    def left_out(self) -> frozenset[int]:
        """Ids of live robots that a leader keeps out of its chain because they are stuck (E22)."""
        return self._memory.left_out

    @left_out.setter
    def left_out(self, robot_ids: frozenset[int]) -> None:
        self._memory.left_out = robot_ids

    @property
    def released(self) -> bool:
        """True if a requested release is complete: the final messages are out and the process may end."""
        return self._memory.released

    @property
    def superseded_by(self) -> int | None:
        """Number of an incarnation of this process that others take for a later one; None if there is none.

        To all of them this process is out, and goes on only under a later number: its caller starts it anew (E23).
        """
        return self._memory.superseded_by

    @property
    def chain(self) -> tuple[int, ...]:
        """Ids of `config.chain`, leader first; computed anew only when the config has changed."""
        config = self._memory.config
        if config is not self._chain_of:
            self._chain_of, self._chain = config, ids(config.chain)
        return self._chain

    @property
    def term(self) -> Term:
        """Term of the lease that this process holds, else of the config that it follows."""
        holder = self._memory.holder
        return holder.term if holder is not None else self._memory.config.version.term

    @property
    def role(self) -> Role:
        m = self._memory
        if m.holder is not None:
            return Role.LEADER
        return Role.FOLLOWER if m.leader is not None and m.me.id in self.chain else Role.WAITING

    @property
    def missing(self) -> tuple[int, ...]:
        """Ids that the first election of the fleet still waits for (E18); empty once a leader is known."""
        m = self._memory
        if not is_first(m.config):
            return ()
        return tuple(i for i in m.election.all_member_ids if not m.peers.knows(i))

    def hello_of(self, id: int) -> tuple[Member, float] | None:
        """Return the sender and the time [s] of the last HELLO heard of `id`; None if none was."""
        return self._memory.hellos.get(id)

    @property
    def peers(self) -> FailureDetector:
        """Incarnations heard and tokens of the other processes, to be read only."""
        return self._memory.peers

    def may_command(self, now: float) -> bool:
        """Return True if leading and `now` is before the lease's expiry (I1, I2)."""
        return self._memory.holder is not None and now < expiry(self._memory)

    def is_settled(self, until: float) -> bool:
        """Return True if leading beyond `until` [s] without a change under way: answers can wait until then."""
        m = self._memory
        return self.may_command(until) and m.candidate is None and m.config.previous is None

    @property
    def is_committed(self) -> bool:
        """True if leading, and quorums have accepted the newest config, with no change of voters under way."""
        m = self._memory
        return m.holder is not None and m.config.previous is None and m.holder.committed(m.config)

    def successor(self, now: float) -> int | None:
        """Return the robot that a leader would hand its lease over to; None if it leads nobody who could take it."""
        m = self._memory
        found = None if m.holder is None else resigning.successor_of(m, m.holder, now)
        return None if found is None else found[0].id

    def commanded(self, now: float) -> None:
        """Record that a command as leader was sent at `now` [s]."""
        self._memory.pending_release.commanded_at = now

    # --- input -------------------------------------------------------------------------------------------------

    def receive(self, src: Member, body: LeaseBody, now: float) -> list[Effect]:
        """Process a message of another process or of the own gateway (FENCED: `src.id` is the gateway's robot)."""
        m = self._memory
        self._deadline_for = None
        self._expire(now)
        if src.id != m.me.id or isinstance(body, Fenced):
            event = self._heard(src, body, now)
            if event is not None:
                self._fire(event, now, src, body)
        return m.drain()

    def tick(self, now: float, again_at: float = SOONEST) -> list[Effect]:
        """Do what is due at `now` [s]; send a round now if it falls due before `again_at` [s], the next tick."""
        m = self._memory
        dues = DUES[state_of(m)]
        for place, deadline in enumerate(DEADLINES):
            due = dues[place]
            if due is not None and now >= due(m, again_at):
                self._fire(deadline.event, now)
                dues = DUES[state_of(m)]
        return m.drain()

    def next_deadline(self, again_at: float = SOONEST) -> float:
        """Return the time [s] of the next tick, for a process that ticks at `again_at` [s] anyway."""
        if self._deadline_for != again_at:
            m, at = self._memory, NEVER
            for wakes in WAKES[state_of(m)]:
                when = wakes(m, again_at)
                if when < at:
                    at = when
            self._deadline_for, self._deadline = again_at, at
        return self._deadline

    def hint(self, id: int, incarnation: int, up: bool, now: float) -> list[Effect]:
        """Process a liveliness event, which proves nothing; a leader closes the chain over a vanished follower (E8)."""
        self._expire(now)
        if up:
            self._memory.peers.appeared(id, incarnation)
        elif id != self._memory.me.id:
            self._memory.peers.vanished(id, incarnation, now)
            self._fire(LeaseEvent.TOKEN_VANISHED, now)
        return self._memory.drain()

    def gateway_term(self, term: Term, now: float, latched: bool = False) -> list[Effect]:
        """Process the own gateway's state from `sensors`: its highest term, and whether it is latched in that term.

        E10: a leader whose gateway has seen a higher term, or is latched in the present one, raises its own term. Any
        other process refuses lower terms from now on, so that its leader raises its own (E24).
        """
        m = self._memory
        self._expire(now)
        if term.n > REACH:
            return m.drain()  # E26: no gateway has been told one
        m.window.know(term.n)
        m.seen, m.gateway_term = max(m.seen, term), max(m.gateway_term, term)
        if m.holder is not None and (term > m.holder.term or (latched and term == m.holder.term)):
            self._fire(LeaseEvent.GATEWAY_BARS, now)
        return self._memory.drain()

    def learn_incarnation(self, incarnation: int | None) -> None:
        """Note the number of this process that its gateway knows (E23); None: it knows none."""
        if incarnation is not None:
            voting.note_later(self._memory, incarnation)

    def request_release(self, now: float) -> list[Effect]:
        """Exit cleanly: stop leading and release the voters; `released` turns True, at once if there is no lease."""
        self._fire(LeaseEvent.LEAVE, now)
        return self._memory.drain()

    def request_handover(self, now: float) -> list[Effect]:
        """Hand the lease of a stuck leader to the next in the chain that answers; release it if none does (E16)."""
        self._expire(now)
        self._fire(LeaseEvent.HAND_OVER, now)
        return self._memory.drain()

    def request_roster(self, roster: Roster, now: float) -> list[Effect]:
        """Change the team as leader: the chain closes over a retired robot, a spare may join (E33, E34).

        It is ignored unless this process leads without a candidacy; nobody retires itself: a leader hands over first.
        """
        self._expire(now)
        if self._memory.me.id not in roster.retired:
            self._fire(LeaseEvent.ROSTER, now, roster)
        return self._memory.drain()

    def request_forget(self, lost: tuple[Member, ...], now: float) -> list[Effect]:
        """Apply an operator's declaration that the incarnations `lost`, and all earlier ones of their ids, are dead.

        E20: it is valid for one attempt of each present candidate, and is ignored while a leader is known or if a later
        incarnation of one of them was heard within t_remove: the operator's clock may be behind theirs.
        """
        self._expire(now)
        self._fire(LeaseEvent.FORGET, now, lost)
        return self._memory.drain()

    # --- the machine -------------------------------------------------------------------------------------------

    def _expire(self, now: float) -> None:
        """Step down if the lease has expired; first action of every call, so that no leader outlasts its lease (E7)."""
        if self._memory.holder is not None and now >= expiry(self._memory):
            self._fire(LeaseEvent.LEASE_EXPIRED, now)

    def _heard(self, src: Member, body: LeaseBody, now: float) -> LeaseEvent | None:
        """Note what any message tells, and return its event; None if it says nothing to act upon."""
        m = self._memory
        if isinstance(body, _AGREEING):
            if body.agreed != m.agreed or not understands(body.wire):
                return LeaseEvent.FOREIGN
            m.census.alike(src.id)
        if not m.window.believes(highest(body), now):
            return None  # E26
        if isinstance(body, Nack) and body.agreement is not None:
            return LeaseEvent.NACK_FOREIGN
        if not isinstance(body, Fenced):  # a gateway's incarnations are not its robot's
            m.peers.heard(src, now)
        if not isinstance(body, Nack):
            return EVENTS.get(type(body))
        voting.hear_refusal(m, body, now)
        return refusal(m, body)

    def _fire(self, event: LeaseEvent, now: float, *given: Any) -> None:
        """Do what the table says for the event in the present state."""
        self._deadline_for = None
        before = state_of(self._memory)
        action = ACTIONS.get((event, before))
        first = len(self._memory.effects)
        if action is not None:
            action(self._memory, *given, now)
        if self._observer is not None:
            effects = self._memory.effects[first:]
            self._observer(Observed(event, before, state_of(self._memory), given, effects))
