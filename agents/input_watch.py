"""Events about the inputs of one robot's own hardware: which is lost, or too slow, and when it is back."""

from __future__ import annotations

from lfa.agents.navigator import Navigator
from lfa.protocol.messages.consensus import Term
from lfa.protocol.outbox import Outbox


class InputWatch:
    """Watch over the inputs that `navigator` uses; `step` is called in each control step."""

    def __init__(self, outbox: Outbox, navigator: Navigator) -> None:
        self._outbox = outbox
        self._navigator = navigator
        self._lost = ""
        """Input that was reported as lost; empty for none."""
        self._slow_scans = False

    def step(self, term: Term, now: float) -> None:
        """Publish an event for each input that is lost or slow since the last step, or is back."""
        navigator = self._navigator
        lost = (navigator.limits.lost_input(now) or "") if navigator.was_placed or navigator.pose_lost else ""
        if lost != self._lost:
            self._lost = lost
            self._outbox.event("input", now, term, {"state": "lost", "input": lost} if lost else {"state": "back"})
        slow_hz = navigator.scan_age.slow_hz
        if (slow_hz is not None) != self._slow_scans:
            self._slow_scans = slow_hz is not None
            rate = {} if slow_hz is None else {"rate_hz": round(slow_hz, 1)}
            state = "slow" if rate else "as fast as needed"
            self._outbox.event("input", now, term, {"state": state, "input": "scan", **rate})
