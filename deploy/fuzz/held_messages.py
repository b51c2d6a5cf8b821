"""Messages held back or lost one by one, by their number: the delays of a systematic search."""

from __future__ import annotations

from lfa.deploy.fuzz.schedules import FIRST_AT_S, Schedule
from lfa.protocol.messages.consensus import LeaseBody
from lfa.world.virtual_time import VirtualTime


class MessageHolder:
    """Filter of a network: counts the messages of leases from the first fault on, and disturbs those of a schedule."""

    def __init__(self, network: VirtualTime, schedule: Schedule) -> None:
        self._network = network
        self._from_s = schedule.faults[0].at if schedule.faults else FIRST_AT_S
        self._held = {held.number: held.by_s for held in schedule.held}
        self._number = -1

    def __call__(self, _src: int, _to: int, _body: LeaseBody) -> float | None:
        """Return how much longer [s] the next message takes; None: it is lost."""
        if self._network.now < self._from_s:
            return 0.0
        self._number += 1
        return self._held.get(self._number, 0.0)
