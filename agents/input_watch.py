"""Events about the inputs of one robot: which of its own hardware's is lost, or too slow, and when it is back; and who
of the fleet says more than is taken.
"""

from __future__ import annotations

from lfa.agents.navigator import Navigator
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.robot import UNSAID_GRANT_S, Sensors
from lfa.protocol.outbox import Outbox

TOLD_S = 10.0
"""Time [s] without a further refusal after which a member counts as quiet again."""


class RefusalWatch:
    """Watch over what this process refuses of others: an event when a member begins, and a text while it goes on."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._last: dict[str, tuple[int, float]] = {}
        """Number refused of each member, and the time [s] at which it last grew."""

    def update(self, refused: tuple[tuple[str, int], ...], term: Term, now: float) -> None:
        """Take the numbers of the members of which most was refused; publish an event for each that begins."""
        for member, number in refused:
            before, grew_at = self._last.get(member, (0, float("-inf")))
            if number > before:
                self._last[member] = number, now
                if now - grew_at > TOLD_S:
                    self._outbox.event("excess", now, term, {"member": member, "refused": number})

    def text(self, now: float) -> str:
        """Return whose messages or tokens are refused at present, and how many since the start; empty for nobody's."""
        present = ((member, number) for member, (number, at) in self._last.items() if now - at <= TOLD_S)
        return ", ".join(f"{number} messages or tokens of {member} refused" for member, number in present)


class InputWatch:
    """Watch over the inputs that `navigator` uses; `step` is called in each control step."""

    def __init__(self, outbox: Outbox, navigator: Navigator, grant_s: float) -> None:
        """`grant_s` is the `T_grant` [s] of the mission, which the robot's gateway must hold too (E25)."""
        self._outbox = outbox
        self._grant_s = grant_s
        self._others_s: float | None = None
        """`T_grant` [s] of the own gateway, if that is another one."""
        self._navigator = navigator
        self._lost = ""
        """Input that was reported as lost; empty for none."""
        self._slow_scans = False

    def fits(self, sensors: Sensors, term: Term, now: float) -> bool:
        """Return whether the gateway of `sensors` holds the team's `T_grant`; publish an event when that changes.

        With another one it would obey a former leader for too long, or nobody for long enough: the robot takes nothing
        from it, has no pose, and is left behind (S6).
        """
        others_s = None if sensors.grant_s in (UNSAID_GRANT_S, self._grant_s) else sensors.grant_s
        if others_s != self._others_s:
            self._others_s = others_s
            holds = {"grant_s": sensors.grant_s, "must_be_s": self._grant_s}
            self._outbox.event("gateway", now, term, {"state": "back" if others_s is None else "other", **holds})
        return others_s is None

    def text(self) -> str:
        """Return what the own gateway holds otherwise than the team; empty for nothing."""
        if self._others_s is None:
            return ""
        return f"its gateway holds T_grant = {self._others_s:g} s: must be {self._grant_s:g} s, as in the mission"

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
