"""One `join` or `retire` of a running team as its operator's side runs it (E33, E34). Pure.

It asks the leader for the team, checks that the change can be, and repeats it until the leader's answer shows that
quorums have accepted it: a leader that dies meanwhile, or hands over because it is to retire itself, changes nothing.
"""

from __future__ import annotations

import msgspec
from msgspec import Struct

from lfa.agents.orders.roster_orders import JOIN, QUESTION, refused_kind
from lfa.protocol.lease.membership import joined, retired, team_of
from lfa.protocol.messages.consensus import Roster, Spare
from lfa.protocol.messages.team import Event
from lfa.protocol.names import robot_id_of

REPEAT_S = 0.2
ANSWER_S = 6.0
"""Time [s] within which a change is accepted; a hand-over and two changes of voters last well below it."""
JOINS_S = 3.0
"""Time [s] after its admission within which a spare that runs is in the chain."""


class RosterState(Struct, frozen=True):
    """A leader's answer: the team as its config has it."""

    robots: tuple[int, ...]
    spares: tuple[Spare, ...]
    retired: tuple[int, ...]
    chain: tuple[int, ...]
    accepted: bool

    @property
    def roster(self) -> Roster:
        return Roster(self.spares, self.retired)

    @property
    def team(self) -> tuple[int, ...]:
        return team_of(self.roster, self.robots)


def state_in(event: Event) -> RosterState | None:
    """Return the team that a leader tells in this event; None if it tells none."""
    if event.kind != QUESTION:
        return None
    try:
        return msgspec.convert(event.data, RosterState)
    except msgspec.ValidationError:
        return None


class RosterOutcome(Struct, frozen=True):
    """Result of a change."""

    robot: int
    accepted: bool
    """True if quorums have accepted it."""
    leader: int | None
    """Robot that leads by then; None: none has answered."""
    chain: tuple[int, ...] = ()
    reason: str = ""
    """Why the leader refused it; empty if it did not."""


class RosterCall:
    """Change `command` of `robot`, asked for at `now` [s]; `slot_of`: the lost robot whose place it takes, or 0."""

    def __init__(self, command: str, robot: int, slot_of: int, now: float) -> None:
        self.command = command
        self.arguments = {"robot": robot, "slot_of": slot_of}
        self._robot = robot
        self._slot_of = slot_of
        self._begun = now
        self._say_at = now
        self._accepted_at: float | None = None
        self._leader: int | None = None
        self._state: RosterState | None = None
        self._reason = ""

    def hear(self, event: Event, now: float) -> None:
        """Process an event of a robot. Raises Refused for a change that cannot be, before it is said."""
        leader = robot_id_of(event.header.sender)
        if leader is None:
            return
        if event.kind == refused_kind(self.command) and event.data.get("robot") == self._robot:
            self._leader, self._reason = leader, str(event.data.get("reason"))
        state = state_in(event)
        if state is None:
            return
        if self._state is None:
            change = (state.roster, state.robots, state.chain, self._robot)
            retired(*change) if self.command != JOIN else joined(*change, self._slot_of)
        self._leader, self._state = leader, state
        if self._is_made(state) and self._accepted_at is None:
            self._accepted_at = now

    def _is_made(self, state: RosterState) -> bool:
        return state.accepted and (self._robot in state.team) == (self.command == JOIN)

    def due(self, now: float) -> bool:
        """Return True if something is to be said now: a question, or once the team is known the change."""
        if now < self._say_at:
            return False
        self._say_at = now + REPEAT_S
        return True

    @property
    def asks(self) -> bool:
        """True while the team is not known yet, or the change is made."""
        return self._state is None or self._accepted_at is not None

    def outcome(self, now: float) -> RosterOutcome | None:
        """Return the result once it is final; a spare that has joined may take a moment to come into the chain."""
        chain = () if self._state is None else self._state.chain
        if self._accepted_at is not None:
            there = (self._robot in chain) == (self.command == JOIN)
            if there or now - self._accepted_at >= JOINS_S:
                return RosterOutcome(self._robot, True, self._leader, chain)
            return None
        if self._reason or now - self._begun >= ANSWER_S:
            return RosterOutcome(self._robot, False, self._leader, chain, self._reason)
        return None
