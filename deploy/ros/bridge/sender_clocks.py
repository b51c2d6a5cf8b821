"""Times of the fleet's messages on one clock: each sender stamps by its own monotonic clock. Pure."""

from __future__ import annotations

from lfa.deploy.recording.simulation_time import WorldTime
from lfa.protocol.messages.header import Header

SENDERS_MAX = 1024
AGE_S_MAX = 60.0
"""Largest age [s] that a message is given: a sender whose clock jumps does not send ROS into the past."""
NS = 1_000_000_000


class SenderClocks:
    """Conversion of senders' stamps to UNIX time, or to the world's time.

    A sender's offset is the least (arrival - stamp) of its last messages: exact on one machine but for the fastest
    message's delay.
    """

    def __init__(self, wall_ns_at_zero: int, *, sim_time: bool) -> None:
        """`wall_ns_at_zero`: UNIX time [ns] at time 0 of the observer's own clock, by which messages arrive."""
        self._wall_ns_at_zero = wall_ns_at_zero
        self._sim_time = sim_time
        self._senders: dict[tuple[str, int], WorldTime] = {}
        self._world = WorldTime()

    @property
    def ready(self) -> bool:
        """False while the world's time is wanted and not known yet."""
        return not self._sim_time or self._world.known

    def see_world(self, at: float, time_s: float) -> None:
        """Take the world's time [s] that arrived at `at` [s]."""
        self._world.see(at, time_s)

    def stamp_ns(self, header: Header, at: float, *, prompt: bool = True) -> int:
        """Return the time [ns] of a message that was taken in at `at` [s]: when its sender stamped it.

        A message that is not `prompt` had waited for the loop, and tells of its sender's clock only if it waited less
        than all others.
        """
        sender = (header.sender, header.incarnation)
        known = self._senders.get(sender)
        if known is None:
            if len(self._senders) >= SENDERS_MAX:
                self._senders.clear()
            known = self._senders[sender] = WorldTime()
        if prompt or not known.known or at - header.stamp < known.offset:
            known.see(at, header.stamp)
        return self.now_ns(max(at - AGE_S_MAX, min(at, header.stamp + known.offset)))

    def now_ns(self, at: float) -> int:
        """Return the time [ns] at `at` [s] of the observer's clock."""
        if self._sim_time:
            return round(self._world.of(at) * NS)
        return self._wall_ns_at_zero + round(at * NS)
