"""Checker of I10: no wheel turns after its gateway's acknowledgement of a stop, before a resume is said."""

from __future__ import annotations

from lfa.deploy.analysis.verification.checker import Checker
from lfa.protocol.lease.timing import Timing
from lfa.protocol.messages.stop import NO_STOP, StopWord


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
