"""Newest reading of each sensor of a user's own, with its age: what a controller or a behaviour of one's own reads."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from msgspec import Struct

from lfa.protocol.messages.robot import SensorReading

SENSORS_MAX = 64
"""Largest number of sensors whose readings are kept; those of further ones are dropped."""


NONE: Mapping[str, OwnReading] = MappingProxyType({})
"""Readings of a robot without sensors of a user's own."""


class OwnReading(Struct, frozen=True, gc=False):
    """One reading: its values by their names, and the time [s] since it arrived."""

    values: dict[str, float]
    age_s: float


class OwnReadings:
    """Newest readings of this robot's own sensors by their names."""

    def __init__(self) -> None:
        self._newest: dict[str, tuple[SensorReading, float]] = {}

    def update(self, reading: SensorReading, now: float) -> None:
        """Take a reading that arrived at `now` [s]."""
        if reading.sensor in self._newest or len(self._newest) < SENSORS_MAX:
            self._newest[reading.sensor] = reading, now

    def at(self, now: float) -> Mapping[str, OwnReading]:
        """Return the newest readings with their ages at `now` [s]."""
        if not self._newest:
            return NONE
        return {name: OwnReading(reading.values, now - came) for name, (reading, came) in self._newest.items()}
