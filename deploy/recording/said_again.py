"""Facts that their event says once and a status says again every second: the term of a leader, roles, and chains.

An event that nobody heard, because a process or its link stood still, would be wrong for the rest of the log. Pure.
"""

from __future__ import annotations

from typing import Any

from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import NO_TERM, Role, Term
from lfa.protocol.messages.robot import Sensors
from lfa.protocol.messages.team import Event, Status
from lfa.protocol.names import robot_id_of
from lfa.protocol.topics import address

HEARD = frozenset({Event, Sensors, Status})
"""Types of the messages that can say such a fact; a look-up spares all others, a recording's most, the rest."""
COUNT_MAX = 2.0**53
"""Greatest number of a term or of a config (`messages/header.py`)."""


class SaidAgain:
    """Memory of what the events so far have said; `late` returns the events that must have been missed."""

    def __init__(self) -> None:
        self._led: set[tuple[int, Term]] = set()
        self._roles: dict[int, str] = {}
        self._chains: dict[int, tuple[Term, int]] = {}
        """Version of each robot's newest chain: term and number."""
        self._gateways: dict[int, Term] = {}
        """Highest term that each robot's gateway has obeyed."""

    def late(self, key: str, message: Message) -> list[Event]:
        """Return an event for each fact in `message`, sent on `key`, that no event has said, marked with `again`."""
        match message:
            case Event():
                self._note(message)
            case Sensors(term_max=term):
                where = address(key)
                self._gateways[(robot_id_of(where.owner) if where else None) or 0] = term
            case Status():
                robot = robot_id_of(message.header.sender)
                return [] if robot is None else self._missed(robot, message)
        return []

    def _note(self, event: Event) -> None:
        robot, term = robot_id_of(event.header.sender), event.term
        match event.kind:
            case "leader_command" if term is not None:
                self._led.add((_number(event, "robot"), term))
            case "role" if robot is not None:
                self._roles[robot] = str(event.data.get("role"))
            case "chain" if robot is not None and term is not None:
                self._chains[robot] = (term, _number(event, "seq"))

    def _missed(self, robot: int, status: Status) -> list[Event]:
        found: list[Event] = []

        def say(kind: str, term: Term | None, **data: Any) -> None:
            found.append(Event(status.header, kind, term, {**data, "again": True}))
            self._note(found[-1])

        leads = status.role is Role.LEADER
        if leads and (robot, status.term) not in self._led and self._gateways.get(robot) == status.term:
            say("leader_command", status.term, robot=robot)
        if status.role.value != self._roles.get(robot, Role.WAITING.value):
            say("role", status.term, role=status.role.value)
        term = Term(_count(status, "config_n"), status.term.issuer, status.term.incarnation)
        version = (term, _count(status, "config_seq"))
        if status.chain and term.n > NO_TERM.n and self._older(robot, version):
            say("chain", term, chain=list(status.chain), seq=version[1])
        return found

    def _older(self, robot: int, version: tuple[Term, int]) -> bool:
        known = self._chains.get(robot)
        return known is None or (known[0].n, known[1]) < (version[0].n, version[1])


def _count(status: Status, name: str) -> int:
    """Return a counter, which is any number where a foreign process says it; 0 for what is none."""
    value = status.counters.get(name, 0.0)
    return int(value) if 0.0 <= value <= COUNT_MAX else 0


def _number(event: Event, name: str) -> int:
    """Return a number in an event's data, which any sender may have written; 0 for anything else."""
    value = event.data.get(name)
    return value if isinstance(value, int) else 0
