"""Grammar and schedule of faults on a running fleet: 'kill leader at 20 s', 'cut 1,2 at 5 s for 3 s'.

One grammar serves a scenario's `faults`, `--fault` and `lfa fault`. Execution does not live here: the launcher sends a
signal, the simulator removes a node from virtual time.
"""

from __future__ import annotations

import re
import signal
from collections.abc import Sequence
from typing import Literal, cast

from msgspec import Struct

from lfa.deploy.faults.link_faults import order
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Mission
from lfa.protocol.names import whole_number

FaultAction = Literal[
    "kill", "stop", "continue", "terminate", "restart", "cut", "heal", "loss", "range", "handover", "hang", "resume",
    "formation", "obstacle", "goal",
]  # fmt: skip

#            action        effect
FAULT_ACTIONS: dict[str, str] = {
    "kill":      "SIGKILL: ends at once, without any message",
    "stop":      "SIGSTOP: frozen, with its messages queued",
    "continue":  "SIGCONT: continues with an outdated state",
    "terminate": "SIGTERM: orderly shutdown",
    "restart":   "starts again after a kill or terminate, with a new incarnation",
    "cut":       "no radio between sides: 3, or 1-2, or 1,2-3,w, or one way 1>2 (w: the world with its witness)",
    "heal":      "ends a cut, or all cuts and all loss",
    "loss":      "every receiver loses this share of messages: 0.2; without a share: the initial value",
    "range":     "messages reach robots up to this distance [m]: 5; 0: any distance",
    "handover":  "the leader hands its lease to the next in the chain",
    "hang":      "a part of a simulated robot hangs: driver 2 (its wheels go on), localization 2 or scanner 2",
    "resume":    "ends a hang of the same part",
    "formation": "the leader orders it, as lfa formation does: left, right, column or zigzag",
    "obstacle":  "a round obstacle is set down: its x, y and radius [m] as 5,1.5,0.3; not where a robot stands",
    "goal":      "the team gets another goal, as by lfa go: its x and y [m] as 3,-1.5; not in or behind a wall",
}  # fmt: skip

SIGNALS: dict[str, signal.Signals] = {
    "kill": signal.SIGKILL,
    "stop": signal.SIGSTOP,
    "continue": signal.SIGCONT,
    "terminate": signal.SIGTERM,
}

ORDERS = ("cut", "heal", "loss", "range", "handover", "hang", "resume", "formation", "obstacle", "goal")
"""Fault actions sent as an operator's message to all, not as a signal to one process."""
GOAL: FaultAction = "goal"
"""Fault action that changes the mission: an order that the leader must carry out (E32)."""
LASTING: dict[str, FaultAction] = {"stop": "continue", "cut": "heal", "loss": "loss", "hang": "resume"}
"""Fault actions that may have a duration, and the action that ends each."""

LEADER = "leader"
RESTART: FaultAction = "restart"
"""Fault action carried out by the launcher; in a fleet that already runs, an operator's message requests it."""
COMMON = ("router", "world")
"""Processes besides robots that can be killed, stopped and continued, where the fleet runs as processes."""
TIME_S_MAX = 1e6
"""Longest time limit [s] of a scenario."""
RIGHT = f"'kill leader at 20 s' or 'stop 2 at 5 s for 3 s' ({', '.join(FAULT_ACTIONS)})"
_SENTENCE = re.compile(
    r"(?P<action>\w+)(?: +(?!at )(?P<target>(?:(?:driver|localization|scanner) +)?[\w.,>-]+(?: +-?[\d.]+)?))?"
    r"(?: +at +(?P<at>\d+(?:\.\d+)?) *s)?"
    r"(?: +for +(?P<duration>\d+(?:\.\d+)?) *s)?",
    re.ASCII,
)


class Fault(Struct, frozen=True):
    """One fault: an action on a target at world time `at_s` [s].

    `target` is a robot's id, `leader` for the leader at that moment, or the argument of an operator command.
    """

    action: FaultAction
    target: int | str
    at_s: float
    for_s: float | None = None
    undoes: bool = False
    """True for the action that ends a lasting fault: among those due at one time it comes after the written ones."""

    def __str__(self) -> str:
        lasting = "" if self.for_s is None else f" for {_plain(self.for_s)} s"
        return " ".join(word for word in (self.action, str(self.target), f"at {_plain(self.at_s)} s{lasting}") if word)


def _plain(seconds: float) -> str:
    """Return a time to the microsecond without an exponent, which the grammar does not know."""
    return f"{seconds:.6f}".rstrip("0").rstrip(".")


def parse(text: str, mission: Mission, where: str = "--fault") -> Fault:
    """Parse one fault. Raises Refused if `text` is not a fault, or names a robot that is not in the mission."""
    match = _SENTENCE.fullmatch(text.strip())
    if match is None or match["action"] not in FAULT_ACTIONS or match["at"] is None:
        raise Refused(f"{where} {text!r}: must be like {RIGHT}")
    if max(float(match["at"]), float(match["duration"] or 0.0)) > TIME_S_MAX:
        raise Refused(f"{where} {text!r}: times must be at most {TIME_S_MAX:g} s, what the longest run lasts")
    if match["action"] in ORDERS:
        target = _ordered(match["action"], " ".join((match["target"] or "").split()), text, mission, where)
    else:
        target = _target(match["target"] or "", text, mission, where)
    for_s = None if match["duration"] is None else float(match["duration"])
    if for_s is not None and match["action"] not in LASTING:
        raise Refused(f"{where} {text!r}: only {', '.join(LASTING)} can be 'for' a while")
    if match["action"] in ("restart", "continue") and target == LEADER:
        raise Refused(f"{where} {text!r}: {match['action']} needs an id, one of {_ids(mission)}")
    return Fault(cast(FaultAction, match["action"]), target, float(match["at"]), for_s)


def parse_all(mission: Mission, from_scenario: Sequence[str], from_operator: Sequence[str]) -> list[Fault]:
    """Return the faults of a run: the scenario's own and those given on the command line. Raises Refused."""
    faults = [parse(text, mission, "scenario.faults") for text in from_scenario]
    return faults + [parse(text, mission) for text in from_operator]


class FaultSchedule:
    """Pending faults, in the order of their times."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        self.pending = sorted(faults, key=_place)

    def add(self, fault: Fault) -> None:
        """Add a fault while the schedule runs: it takes the place that it has in a schedule written beforehand."""
        self.pending.append(fault)
        self.pending.sort(key=_place)

    def due(self, now: float, leader: int | None) -> list[tuple[FaultAction, int | str]]:
        """Return the actions and targets due at world time `now` [s]; a fault on the leader waits until one exists."""
        actions: list[tuple[FaultAction, int | str]] = []
        while self.pending and self.pending[0].at_s <= now:
            fault = self.pending[0]
            victim = leader if fault.target == LEADER else fault.target
            if victim is None:
                break
            self.pending.pop(0)
            actions.append((fault.action, victim))
            if fault.for_s is not None:
                undone = "" if fault.action == "loss" else victim
                self.add(Fault(LASTING[fault.action], undone, now + fault.for_s, undoes=True))
        return actions


def _place(fault: Fault) -> tuple[float, bool]:
    return fault.at_s, fault.undoes


def _ordered(action: str, word: str, text: str, mission: Mission, where: str) -> int | str:
    """Return the target of an operator command: empty, `leader`, one robot's id, or its argument. Raises Refused."""
    if action == "handover" and word not in ("", LEADER):
        raise Refused(f"{where} {text!r}: only the leader hands over")
    if action == "handover" or (action == "cut" and word == LEADER):
        return LEADER
    if action == GOAL:  # 3 -1.5 is 3,-1.5
        word = ",".join(word.replace(",", " ").split())
    try:
        order(action, word, mission.robots)
    except Refused as refused:
        raise Refused(f"{where} {text!r}: {refused}") from None
    robot = whole_number(word) if action in ("cut", "heal") else None
    return word if robot is None else robot


def _target(word: str, text: str, mission: Mission, where: str) -> int | str:
    if word == LEADER or word in COMMON:
        return word
    robot = whole_number(word.removeprefix("robot"))
    if robot is None or robot not in mission.robots:
        raise Refused(f"{where} {text!r}: no robot {word!r}, must be leader, router, world or one of {_ids(mission)}")
    return robot


def _ids(mission: Mission) -> str:
    return ", ".join(str(robot_id) for robot_id in mission.robots)
