"""Checkers of the fleet stop: I10, no wheel turns between the acknowledgement of a stop and a resume; and I16, none
turns at a gateway that may not know.
"""

from __future__ import annotations

from lfa.deploy.analysis.verification.checker import Checker
from lfa.protocol.lease.timing import Timing
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
    it since; what makes it certain is a command of a certain agent, or a word that names its incarnation (E30).
    """

    name = "I16"

    def __init__(self, timing: Timing) -> None:
        super().__init__(timing)
        self._certain: set[int] = set()
        self._word: dict[int, StopWord] = {}

    def gateway_starts(self, at: float, robot_id: int, shut_until: float) -> None:
        self._certain.discard(robot_id)
        self._word[robot_id] = NO_STOP

    def hears_order(self, at: float, robot_id: int, incarnation: int, order: StopOrder) -> None:
        if order.word is None or order.word < self._word.get(robot_id, NO_STOP):
            return
        self._word[robot_id] = order.word
        if any((one.id, one.incarnation) == (robot_id, incarnation) for one in order.gateways):
            self._certain.add(robot_id)

    def obeys(self, at: float, robot_id: int, cmd: CmdVel, age: float) -> None:
        if cmd.stop.word > self._word.get(robot_id, NO_STOP) and (cmd.stop.word.stand or robot_id not in self._certain):
            self._word[robot_id] = cmd.stop.word
        if cmd.stop.certain:
            self._certain.add(robot_id)

    def turns(self, at: float, robot_id: int, word: StopWord) -> None:
        if robot_id not in self._certain:
            self.broken(at, f"robot {robot_id} drives, and its gateway may not know of a stop")
        elif self._word.get(robot_id, NO_STOP).stand:
            stop = self._word[robot_id]
            resume = "an older resume" if word < stop else "a later resume by its agent alone"
            knows = "a stop" if word.stand else resume
            self.broken(at, f"robot {robot_id} drives after a stop reached its gateway, which knows {knows}")
