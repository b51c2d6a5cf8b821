"""Checkers of the fleet stop: I10, no wheel turns between the acknowledgement of a stop and a resume; and I16, none
turns at a gateway that may not know.
"""

from __future__ import annotations

from math import inf

from lfa.deploy.analysis.verification.checker import EARLY_S, LONG_AGO, Checker
from lfa.protocol.lease.timing import CLOCK_RATE_ERROR, Timing
from lfa.protocol.messages.consensus import Member
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.stop import NO_STOP, StopOrder, StopWord


class StopHolds(Checker):
    """I10. A robot whose agent and gateway have both forgotten is not held to what it has acknowledged before."""

    name = "I10"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._acknowledged: dict[int, StopWord] = {}
        self._resumed = NO_STOP

    def stop_acknowledged(self, at: float, robot_id: int, word: StopWord) -> None:
        self._acknowledged[robot_id] = max(self._acknowledged.get(robot_id, word), word)

    def stop_forgotten(self, at: float, robot_id: int) -> None:
        self._acknowledged.pop(robot_id, None)

    def resume_said(self, at: float, word: StopWord) -> None:
        self._resumed = max(self._resumed, word)

    def turns(self, at: float, robot_id: int, word: StopWord) -> None:
        acknowledged = self._acknowledged.get(robot_id)
        if acknowledged is not None and acknowledged > self._resumed:
            self.broken(at, f"robot {robot_id} drives after it acknowledged stop {acknowledged.epoch}")


class LatchKept(Checker):
    """Checker of I16: wheels turn only at a gateway that is certain, and by no word that its agent alone has said to
    it since; what makes it certain is a command of a certain agent, or a word that names its incarnation (E30). An
    agent that says to be certain has been told by a certain gateway, or by so many agents that they are more than half
    of the team with it; where that is not observed, it is believed. With `operator_timeout_s` wheels turn for so long
    after an order that the gateway had not heard before, and no longer (E31).
    """

    name = "I16"

    def __init__(self, timing: Timing, operator_timeout_s: float | None = None) -> None:
        super().__init__(timing)
        self._silence_s = inf if operator_timeout_s is None else operator_timeout_s / (1.0 - CLOCK_RATE_ERROR)
        self._newest: dict[tuple[int, int], int] = {}
        """Number of the newest order that a robot's gateway has heard of an operator."""
        self._contact_at: dict[int, float] = {}
        self._robots: set[int] = set()
        self._heard: dict[Member, set[int]] = {}
        """Robots whose agents an agent has heard, itself included."""
        self._sure: set[Member] = set()
        self._asks_agents = False
        """True where it is observed who tells an agent."""
        self._certain: set[int] = set()
        self._word: dict[int, StopWord] = {}

    def names(self, at: float, robots: tuple[int, ...]) -> None:
        self._robots = set(robots)

    def told_of_stop(self, at: float, agent: Member, by: int) -> None:
        self._asks_agents = True
        heard = self._heard.setdefault(agent, {agent.id})
        heard.update({by} & self._robots)
        if 2 * len(heard) > len(self._robots) or (by == agent.id and by in self._certain):
            self._sure.add(agent)

    def gateway_starts(self, at: float, robot_id: int, shut_until: float) -> None:
        self._certain.discard(robot_id)
        self._word[robot_id] = NO_STOP
        self._contact_at.pop(robot_id, None)
        self._newest = {who: seq for who, seq in self._newest.items() if who[0] != robot_id}

    def hears_order(self, at: float, robot_id: int, incarnation: int, order: StopOrder) -> None:
        who, seq = (robot_id, order.header.incarnation), order.header.seq
        if seq > self._newest.get(who, -1):
            self._newest[who], self._contact_at[robot_id] = seq, at
        if order.word is None or order.word < self._word.get(robot_id, NO_STOP):
            return
        self._word[robot_id] = order.word
        if any((one.id, one.incarnation) == (robot_id, incarnation) for one in order.gateways):
            self._certain.add(robot_id)

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        if cmd.stop.word > self._word.get(robot_id, NO_STOP) and (cmd.stop.word.stand or robot_id not in self._certain):
            self._word[robot_id] = cmd.stop.word
        if cmd.stop.certain and (not self._asks_agents or Member(robot_id, cmd.header.incarnation) in self._sure):
            self._certain.add(robot_id)

    def turns(self, at: float, robot_id: int, word: StopWord) -> None:
        if robot_id not in self._certain:
            self.broken(at, f"robot {robot_id} drives, and its gateway may not know of a stop")
        elif self._word.get(robot_id, NO_STOP).stand:
            stop = self._word[robot_id]
            resume = "an older resume" if word < stop else "a later resume by its agent alone"
            knows = "a stop" if word.stand else resume
            self.broken(at, f"robot {robot_id} drives after a stop reached its gateway, which knows {knows}")
        elif at - self._contact_at.get(robot_id, LONG_AGO) > self._silence_s + EARLY_S:
            self.broken(at, f"robot {robot_id} drives, and no operator has said anything new for too long")
