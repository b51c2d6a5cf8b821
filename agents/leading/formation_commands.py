"""Orientation requests of a leader: formation, time, term and number (control.md section 4).

Requests come from the mission at points of the route, and from an operator. Before a bend in which the outermost robot
could not keep up, the chain changes to column. It does so before a narrow gap and on the way round a trap, too, and
takes its formation again behind it. With known obstacles the chain stays in column all the time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi
from typing import NamedTuple

from lfa.agents.formation.formation import Formation, named, slots_of
from lfa.agents.leading.path_follower import PathFollower
from lfa.protocol.errors import Refused
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.team import FormationNote, Slot
from lfa.protocol.mission import Mission
from lfa.protocol.outbox import Outbox

REPEAT_S = 1.0
BEND_CHECK_S = 0.5
FOLD_S = 6.0
"""Time [s] between the column orders of two hops: each swings for half of it, then comes to rest. If all changed at
once, the last slot would swing with all before it and go a longer way."""
ORDER_S_MAX = 5.0
"""Age [s] up to which a new leader carries out an operator's order that no leader has carried out."""
BEND_AHEAD_M = 5.0
"""Distance [m] ahead within which bends are checked: enough for a chain of four to form a column at cruise speed."""
OPEN_M = 3.0
"""Progress [m] without a narrow place after which the team takes its formation again."""


class LedTeam(NamedTuple):
    """Team of a leader at one moment: its followers in their order, the leader's term, the time [s]."""

    followers: Sequence[int]
    term: Term
    now: float


class FormationCommands:
    """Formation requests of one robot while it leads; `begin` starts its term as leader."""

    def __init__(self, outbox: Outbox, mission: Mission, formation: Formation) -> None:
        self._outbox = outbox
        self._mission = mission
        self._formation = formation
        self._number = 0
        self._next: int | None = None
        self._pending: tuple[str, float] | None = None
        """Last order of an operator, and when it came, while another robot leads."""
        self._repeat_at = 0.0
        self._check_at = self._fold_at = 0.0
        self._narrow_m: float | None = None
        """Progress [m] at the last narrow place for which the chain is in column; None when it is not."""
        self._side: str = mission.formation.side
        """Side before the narrow place."""

    def change(self, mission: Mission) -> None:
        """Use the formation and the orientations of a mission that an operator has changed."""
        self._mission, self._next = mission, None

    def remember(self, side: str, now: float) -> None:
        """Keep an operator's order of another robot's term, which that robot may not live to carry out."""
        self._pending = side, now

    def hear(self, note: FormationNote) -> None:
        """Update with a new request of another robot that leads: what was to be carried out has been, or is older."""
        if note.number > 0:
            self._pending = None

    def begin(self, now: float) -> None:
        """Start a term: requests of this term count from 0."""
        self._number, self._repeat_at, self._next = 0, now, None

    def lead(
        self, lead: PathFollower, followers: Sequence[int], term: Term, now: float, narrow: Callable[[], str | None]
    ) -> None:
        """Run one control step of the leader: requests that are due on the route, and the present request once a
        second. `narrow` returns the reason why only a column passes what is ahead, or None.
        """
        orientations = () if self._mission.leading.known_m else self._mission.leading.orientations
        if self._next is None:  # what the route has asked for so far was the former leader's to order
            self._next = sum(orientation.at_m <= lead.reached_m for orientation in orientations)
            self._carry_out(followers, term, now)
        while self._next < len(orientations) and orientations[self._next].at_m <= lead.progress_m:
            self.order(orientations[self._next].side, "mission", followers, term, now)
            self._next += 1
        if now >= self._check_at:
            self._check_at = now + BEND_CHECK_S
            self._column_where_narrow(lead, LedTeam(followers, term, now), narrow)
        if now >= self._repeat_at:
            self._say(self._slots(followers), term, now)

    def order(self, side: str, reason: str, followers: Sequence[int], term: Term, now: float) -> None:
        """Publish a new request to all followers; an unknown side is ignored."""
        try:
            spec = named(side, self._mission.formation)
        except Refused:
            return
        self._number += 1
        if reason in ("mission", "operator"):
            self._narrow_m = None
        self._formation.side = side
        self._say(slots_of(spec, followers), term, now)
        self._outbox.event("formation", now, term, {"number": self._number, "side": side, "by": reason})

    def _carry_out(self, followers: Sequence[int], term: Term, now: float) -> None:
        """Carry out an operator's order that came too late for the former leader."""
        side, at = self._pending or ("", now)
        if side and side != self._formation.side and now - at <= ORDER_S_MAX:
            self.order(side, "operator", followers, term, now)
        self._pending = None

    def _slots(self, followers: Sequence[int]) -> tuple[Slot, ...]:
        """Return the present slots; a robot that led when they were ordered gets the one of its place in the chain."""
        if not self._formation.side:
            return tuple(self._formation.slot_of(robot) for robot in followers)
        ordered = slots_of(named(self._formation.side, self._mission.formation), followers)
        return tuple(
            self._formation.slot_of(slot.robot) if self._formation.is_named(slot.robot) else slot for slot in ordered
        )

    def _column_where_narrow(self, lead: PathFollower, team: LedTeam, narrow: Callable[[], str | None]) -> None:
        """Order column before a bend that the formation cannot follow, before what is narrow, and where obstacles are
        known (the route passes them).
        """
        slots = [self._formation.slot_of(robot) for robot in team.followers]
        if self._formation.trace:
            return
        if self._narrow_m is not None:
            self._open_again(lead, team, narrow)
            return
        if all(map(_behind, slots)):
            return
        if self._mission.leading.known_m:
            self._fold(slots, team)
            return
        reason = narrow()
        if reason is not None:
            self._narrow_m, self._side = lead.progress_m, self._formation.side or self._mission.formation.side
            self.order("column", reason, *team)
            return
        ahead_m = lead.narrow_bend_m(slots, BEND_AHEAD_M)
        if ahead_m is not None:
            self.order("column", f"bend in {ahead_m:.1f} m", *team)

    def _open_again(self, lead: PathFollower, team: LedTeam, narrow: Callable[[], str | None]) -> None:
        """Order the formation of before the narrow place once the team is well behind it."""
        if self._narrow_m is None or narrow() is not None:
            self._narrow_m = lead.progress_m
        elif lead.progress_m - self._narrow_m >= OPEN_M:
            self._narrow_m = None
            self.order(self._side, "the narrow place is passed", *team)

    def _fold(self, slots: Sequence[Slot], team: LedTeam) -> None:
        """Order column past known obstacles, starting with the last hop that is not yet in column."""
        followers, term, now = team
        if now < self._fold_at:
            return
        self._fold_at = now + FOLD_S
        last = max(n for n, slot in enumerate(slots) if not _behind(slot))
        column = slots_of(named("column", self._mission.formation), followers)
        self._number += 1
        self._say((*slots[:last], *column[last:]), term, now)
        note = {"number": self._number, "side": "column", "by": "known obstacles", "robot": followers[last]}
        self._outbox.event("formation", now, term, note)

    def _say(self, slots: tuple[Slot, ...], term: Term, now: float) -> None:
        header = self._outbox.header("formation", now)
        note = FormationNote(header, term, self._number, slots, self._formation.trace, self._formation.side)
        self._formation.request(note)
        self._outbox.publish("formation", note)
        self._repeat_at = now + REPEAT_S


def _behind(slot: Slot) -> bool:
    return abs(abs(slot.phi) - pi) < 1e-6
