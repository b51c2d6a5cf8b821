"""Times at which a process declares its subscriptions again: links between routers can lose declarations (pure)."""

from __future__ import annotations

from lfa.protocol.node import Local, PeerDown, PeerUp, RouterLost

ANEW_S = (1.5, 6.5)
"""Delays [s] from a liveliness event: routers retry links every second, and a busy machine takes longer."""
NAMES_MAX = 1024
"""Maximum number of names whose vanished tokens are remembered."""
AGAIN_S = (3.0, 12.0)
"""First and maximum interval [s] while a process lacks messages; each is twice the one before.

A fleet that starts on a busy machine lacks messages for seconds though no declaration is lost, and each repeat takes
processor time from all its routers.
"""


class Links:
    """When to declare the subscriptions again: after events that hint at a broken link, and as long as messages lack.

    A busy router permanently drops declarations that cross a link while it recovers (zenoh#1886), and with them the
    subscribed messages. A link may have broken when a token vanishes, when one reappears with the same incarnation, or
    when any token appears after the own link was lost. But routers may flap for longer than any delay after such an
    event, so a process that still lacks messages goes on, at a bounded rate.
    """

    def __init__(self) -> None:
        self._due: list[float] = []
        self._gone: dict[str, int] = {}
        """Incarnation of the token that vanished last, by name."""
        self._cut_off = False
        self._again_at = float("inf")
        self._again_s = AGAIN_S[0]

    @property
    def anew_at(self) -> float:
        return min(self._due[0] if self._due else float("inf"), self._again_at)

    def see(self, event: Local, now: float) -> None:
        match event:
            case PeerDown(name, incarnation):
                if len(self._gone) >= NAMES_MAX:
                    self._gone.clear()
                self._gone[name] = incarnation
            case PeerUp(name, incarnation) if self._cut_off or self._gone.get(name) == incarnation:
                self._gone.pop(name, None)
            case RouterLost():
                self._cut_off = True
                return
            case _:
                return
        self._due = [now + after_s for after_s in ANEW_S]

    def lacks(self, lacks: bool, now: float) -> None:
        """Note at `now` [s] whether the process lacks messages that its team sends (`Node.lacks_messages`)."""
        if not lacks:
            self._again_at, self._again_s = float("inf"), AGAIN_S[0]
        elif self._again_at == float("inf"):
            self._again_at = now + self._again_s

    def due(self, now: float) -> bool:
        """Return True once for each due time."""
        if now < self.anew_at:
            return False
        if now >= self._again_at:
            self._again_s = min(2.0 * self._again_s, AGAIN_S[1])
            self._again_at = now + self._again_s
        if self._due and now >= self._due[0]:
            self._due.pop(0)
        self._cut_off = False
        return True
