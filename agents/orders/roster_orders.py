"""The operator's word at one robot on who is in the team: spares that join, robots that retire (E33, E34).

The leader writes it into its config, and answers each call with the team as quorums have accepted it; so the operator
repeats a call until an answer shows the change, also if another robot leads by then.
"""

from __future__ import annotations

from typing import Any

from lfa.agents.attendance import is_heard
from lfa.protocol.errors import Refused
from lfa.protocol.lease.effects import Effect
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.membership import is_spare, joined, retired, team_of
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.team import OperatorNote
from lfa.protocol.mission import Mission
from lfa.protocol.names import robot_name
from lfa.protocol.outbox import Outbox

JOIN, RETIRE, QUESTION = "join", "retire", "roster"
ROBOT_MAX = 2**31


class RosterOrders:
    """Calls to join and to retire, as robot `robot_id` of `lease` hears them."""

    def __init__(self, robot_id: int, mission: Mission, lease: Lease, outbox: Outbox) -> None:
        self._id = robot_id
        self._robots = mission.robots
        self._lease = lease
        self._outbox = outbox

    def text(self) -> str:
        """Return why this robot is not in the team, as text for its status; empty if it is."""
        roster = self._lease.config.roster
        if self._id in roster.retired:
            return f"retired: lfa join {self._id} takes it back"
        if self._id in self._robots or is_spare(roster, self._id):
            return ""
        return f"a spare: lfa join {self._id} takes it in"

    def obey(self, note: OperatorNote, now: float) -> tuple[list[Effect], bool]:
        """Process a call as leader; return the effects of the lease, and whether to hand it over first."""
        if self._lease.role is not Role.LEADER:
            return [], False
        robot, slot_of = _id(note.arguments.get("robot")), _id(note.arguments.get("slot_of", 0))
        if not robot or slot_of is None:
            return [], False
        effects: list[Effect] = []
        hands_over = False
        try:
            effects, hands_over = self._change(note.command, robot, slot_of, now)
        except Refused as refused:
            self._event(refused_kind(note.command), {"robot": robot, "reason": str(refused)}, now)
            return [], False
        self.answer(now)
        return effects, hands_over

    def answer(self, now: float) -> None:
        """Tell the team as leader."""
        config = self._lease.config
        spares = [[spare.id, spare.slot_of] for spare in config.roster.spares]
        data = {"robots": list(self._robots), "spares": spares, "retired": list(config.roster.retired)}
        self._event("roster", {**data, "chain": list(self._lease.chain), "accepted": self._lease.is_committed}, now)

    def _change(self, command: str, robot: int, slot_of: int, now: float) -> tuple[list[Effect], bool]:
        """Return the effects of a change, none if it is made. Raises Refused for one that cannot be."""
        lease, roster = self._lease, self._lease.config.roster
        if (robot in team_of(roster, self._robots)) == (command == JOIN):
            return [], False
        if command == JOIN:
            newer = joined(roster, self._robots, lease.chain, robot, slot_of)
            if not is_heard(robot, lease, now):
                started = f"lfa-agent --id {robot}{'' if robot in self._robots else ' --spare'}"
                raise Refused(f"join {robot}: nobody of this id is heard, must run first: {started}")
            return lease.request_roster(newer, now), False
        newer = retired(roster, self._robots, lease.chain, robot)
        if robot != self._id:
            return lease.request_roster(newer, now), False
        if lease.successor(now) is None:
            raise Refused(
                f"retire {robot}: {robot_name(robot)} leads, and no other robot that may lead is in its chain"
            )
        return [], True

    def _event(self, kind: str, data: dict[str, Any], now: float) -> None:
        self._outbox.event(kind, now, self._lease.term, data)


def refused_kind(command: str) -> str:
    """Return the kind of the event by which a leader refuses a call."""
    return f"{command}_refused"


def _id(value: object) -> int | None:
    """Return an id or 0 as an operator's message has it; None for anything else."""
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= ROBOT_MAX else None
