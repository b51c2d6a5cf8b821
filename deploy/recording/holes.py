"""Holes of a recording: gaps in the sequence numbers of a sender's topic. Pure: times are arguments."""

from __future__ import annotations

from lfa.deploy.recording.recorder import Hole
from lfa.protocol.messages.header import Header
from lfa.protocol.topics import TOPIC, address

STATE_GAP_MAX = 5
"""Longest gap of a topic of which only the newest value counts; any message of another topic is missed."""
HOLES_KEPT = 20
STREAMS_MAX = 16384
"""Maximum number of streams whose sequence numbers are followed."""


class Holes:
    """Sequence numbers of each stream, and the gaps in them."""

    def __init__(self) -> None:
        self.missing = 0
        """Number of missing messages over all streams, short gaps of state topics included."""
        self._last: dict[tuple[str, str, int], tuple[int, float]] = {}
        """Number and time [s] of the last message of each stream."""
        self._found: dict[str, Hole] = {}

    def see(self, at: float, key: str, header: Header) -> None:
        """Count a message sent on `key` that arrived at `at` [s] of the run."""
        where = address(key)
        if where is None:
            return
        name = f"{where.owner}/{where.topic}"
        stream = (name, header.sender, header.incarnation)
        if len(self._last) >= STREAMS_MAX:  # a member may invent incarnations
            self._last.clear()
        before, since = self._last.get(stream, (header.seq - 1, at))
        gap = header.seq - before - 1
        if gap > 0:
            self.missing += gap
            if gap > STATE_GAP_MAX or not TOPIC[where.topic].state:
                self._widen(name, gap, since, at)
        if header.seq > before:
            self._last[stream] = (header.seq, at)

    def widest(self) -> list[Hole]:
        """Return the streams with holes, the one with the most missing messages first."""
        return sorted(self._found.values(), key=lambda hole: -hole.missing)[:HOLES_KEPT]

    def _widen(self, name: str, gap: int, since: float, at: float) -> None:
        hole = self._found.get(name)
        if hole is None and len(self._found) >= STREAMS_MAX:
            return
        if hole is None:
            self._found[name] = Hole(name, gap, round(since, 3), round(at, 3))
        else:
            hole.missing, hole.until_s = hole.missing + gap, round(at, 3)
