"""What a robot has heard of others, with its age: the paper's table, and the clocks of those whose poses it uses."""

from __future__ import annotations

from agents.clocks import ClockOffset
from protocol.geometry import Pose2D
from protocol.messages import Delay, Sensors, TableRow
from protocol.topics import TOPIC

ROBOTS_MAX = 512


class Beliefs:
    """Latest values, each fresh or stale by the topic table."""

    def __init__(self) -> None:
        self.sensors: Sensors | None = None
        self.sensors_at = -1.0
        self._table: dict[int, tuple[TableRow, float]] = {}
        self._clocks: dict[int, ClockOffset] = {}

    def hear_sensors(self, sensors: Sensors, at: float) -> None:
        self.sensors, self.sensors_at = sensors, at

    def hear_row(self, robot: int, row: TableRow, at: float) -> None:
        """Row of `robot`; an older one than the last of the same life is dropped."""
        known = self._table.get(robot)
        if known is not None and _order(row) <= _order(known[0]):
            return
        if known is None and len(self._table) >= ROBOTS_MAX:
            return
        if known is None or known[0].header.incarnation != row.header.incarnation:
            self._clocks[robot] = ClockOffset()
        self._table[robot] = (row, at)
        self._clocks[robot].heard(row.header.stamp, at)

    def fresh_sensors(self, now: float) -> Sensors | None:
        return self.sensors if now - self.sensors_at <= (TOPIC["sensors"].timeout_s or 0.0) else None

    def pose_of(self, robot: int, now: float) -> Pose2D | None:
        """Last known place of `robot` in `map`, None when it is stale."""
        known = self._table.get(robot)
        if known is None or now - known[1] > (TOPIC["table"].timeout_s or 0.0):
            return None
        row = known[0]
        return Pose2D(row.x, row.y, row.theta)

    def delays(self, robots: tuple[int, ...], now: float) -> tuple[Delay, ...]:
        """Least (receive - send) of these robots' rows: their half of a round trip (control.md 3.3)."""
        clocks = [(robot, self._clocks.get(robot)) for robot in robots]
        return tuple(Delay(robot, clock.least(now)) for robot, clock in clocks if clock is not None and clock.known)


def _order(row: TableRow) -> tuple[int, int]:
    return row.header.incarnation, row.header.seq
