"""Table of a run's leaders: who led since when, in which term, and why the leader changed. Pure."""

from __future__ import annotations

from typing import Any

from lfa.deploy.client.term_count import TermCount
from lfa.protocol.names import robot_id_of

ENDINGS = {
    "kill": "was killed",
    "terminate": "was asked to end",
    "stop": "was frozen",
    "cut": "was cut off",
    "hang": "hung in part",
    "died": "died",
    "handover": "was asked to hand over",
}
"""What a fault did to the leader that it hit."""
CHANGES = {
    "expired": "could not renew its lease",
    "released": "released its lease",
    "handed_over": "handed its lease over",
    "deposed": "stepped down for a higher term",
}
"""What a holder's own lease event says about the end of its term."""


class LeaderTable:
    """Leaders so far, from the events of a run; `see` returns the entry of a new one."""

    def __init__(self) -> None:
        self.leader: int | None = None
        self.term = 0
        self.leads: list[dict[str, Any]] = []
        self.stepped_down = False
        """True after a holder's lease ended, until another lease begins."""
        self._term: tuple[int, int] = (0, 0)
        self._count = TermCount()
        self._hit: dict[int, str] = {}
        """How the present term of each robot was ended, or is about to be."""

    def see(self, t: float, owner: str, event: Any) -> dict[str, Any] | None:
        """Update with an event; return t [s], robot, term and why, if another leader or term begins with it."""
        data, kind = event.data, event.kind
        robot = data.get("robot") if isinstance(data.get("robot"), int) else robot_id_of(owner)
        match kind:
            case "fault":
                self._note_fault(str(data.get("deed")), data.get("robot"))
            case "died" if robot is not None:
                self._hit.setdefault(robot, ENDINGS["died"])
            case "lease" if robot is not None and str(data.get("change")) in CHANGES:
                self._hit.setdefault(robot, CHANGES[str(data["change"])])
                self.stepped_down = True
            case "stuck" if robot is not None:
                self._hit.setdefault(robot, "was stuck and handed its lease over")
            case "leader_command" if robot is not None and event.term is not None:
                return self._begin(t, robot, (int(event.term.n), int(event.term.issuer)))
        return None

    def found(self, t: float, robot: int, term: tuple[int, int]) -> dict[str, Any] | None:
        """Return the entry of a leader that led before anybody looked; None if one is known."""
        if self.leader is not None:
            return None
        entry = self._begin(t, robot, term)
        if entry is not None:
            entry["why"] = "led already when this page began to look"
        return entry

    def _note_fault(self, action: str, target: Any) -> None:
        hit = self.leader if target == "leader" else target
        if isinstance(hit, str) and action == "cut" and self.leader is not None:
            hit = self.leader if str(self.leader) in hit.replace(">", ",").replace("-", ",").split(",") else hit
        if isinstance(hit, int) and action in ENDINGS:
            self._hit[hit] = ENDINGS[action]
        elif isinstance(hit, int) and action in ("restart", "continue", "heal"):
            self._hit.pop(hit, None)

    def _begin(self, t: float, robot: int, term: tuple[int, int]) -> dict[str, Any] | None:
        if term <= self._term:
            return None
        before = self.leader
        if before is None:
            why = "the first in the chain, elected by a majority"
        elif before == robot:
            why = "elected again"
        else:
            why = f"robot {before} {self._hit.get(before, 'handed its lease over')}"
        self._hit.pop(robot, None)
        self.stepped_down = False
        self._term, self.term, self.leader = term, self._count.number(term[0]), robot
        self.leads.append({"t": round(t, 3), "robot": robot, "term": self.term, "why": why})
        return self.leads[-1]
