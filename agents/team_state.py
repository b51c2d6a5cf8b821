"""State of the other robots as received, with its age: the paper's table, and the clock offsets of their senders."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, inf

from lfa.agents.localization.clock_offset import ClockOffset
from lfa.agents.perception.shared_obstacles import SharedObstacles
from lfa.protocol.geometry import Pose2D
from lfa.protocol.incarnations import is_later
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import Sensors
from lfa.protocol.messages.team import Delay, RouteProgress, TableRow
from lfa.protocol.mission import Mission
from lfa.protocol.topics import TOPIC

ROBOTS_MAX = 1024
SENSORS_PERIODS_MIN = 3
"""Least number of control periods after which the own odometry counts as lost: as many as the deadman's."""
ROW_S_MIN = 0.05
ROW_S_MAX, SENSORS_S_MAX = TOPIC["table"].timeout_s or 0.0, TOPIC["sensors"].timeout_s or 0.0
TABLE_S = 0.5
TABLE_ROBOTS_FULL_RATE = 16
"""Number of robots up to which table rows keep their full rate. Larger teams publish their rows less often, because the
table's traffic grows with the square of their number."""
ROW_SPARE_S = 0.5 * ROW_S_MAX
GOES_ON_S = 0.6
"""Time [s] after its last row for which a robot's motion is extrapolated."""
ROUNDING_M = 1e-6
AROUND_M = 2.0
"""Way [m] along x or y after which a robot looks anew which of its team are around it."""


class TeamState:
    """Latest values, each fresh or stale by the topic table; the own sensors are fresh for `sensors_s_max` [s]."""

    def __init__(self, sensors_s_max: float = SENSORS_S_MAX, report_s_max: float = ROW_S_MAX) -> None:
        """`report_s_max`: age [s] up to which it counts what a row says besides its place."""
        self.report_s_max = report_s_max
        self._sensors_s_max = sensors_s_max
        self.sensors: Sensors | None = None
        self.sensors_at = -1.0
        self.rows_heard = self.rows_lost = 0
        """Numbers of table rows received and lost, over all robots; a gap in a sender's numbers counts as lost. They
        show the quality of the radio link."""
        self._table: dict[int, tuple[TableRow, float]] = {}
        self._robots: tuple[int, ...] | None = ()
        """Robots in the order of their ids; None while that has to be sorted anew."""
        self._velocity: dict[int, tuple[float, float]] = {}
        """Velocity in `map`, from one row to the next."""
        self._reach: dict[int, tuple[float, float, float, float]] = {}
        """Place [m] of each robot's last row, and how far [m] along x and y its extrapolation may take it."""
        self._around: dict[float, _Vicinity] = {}
        """Robots around this one by the distance [m] asked for, whole metres and more; none that must be found anew."""
        self._clocks: dict[int, ClockOffset] = {}
        self.obstacles = SharedObstacles(self.poses)
        """Moving obstacles that other robots reported."""
        self.route = 0
        """Version of the order that gave the team's present route."""
        self.progress: RouteProgress | None = None
        """Progress of the team on its route: the own one while this robot leads, else the leader's as last heard."""

    @property
    def robots(self) -> tuple[int, ...]:
        """Robots of which a row was heard, in the order of their ids."""
        if self._robots is None:
            self._robots = tuple(sorted(self._table))
        return self._robots

    def hear_sensors(self, sensors: Sensors, at: float) -> None:
        self.sensors, self.sensors_at = sensors, at

    def hear_row(self, robot: int, row: TableRow, at: float) -> None:
        """Update with a row of `robot`; one that a later one has overtaken is dropped."""
        known = self._table.get(robot)
        if known is not None and _overtaken(row.header, known[0].header, at - known[1]):
            return
        if known is None and len(self._table) >= ROBOTS_MAX:
            return
        if known is None or known[0].header.incarnation != row.header.incarnation:
            self._clocks[robot] = ClockOffset()
            self._velocity[robot] = (0.0, 0.0)
        elif not (known[0].placed and row.placed):
            self._velocity[robot] = (0.0, 0.0)
        else:
            dt = max(row.header.stamp - known[0].header.stamp, ROW_S_MIN)
            self._velocity[robot] = ((row.x - known[0].x) / dt, (row.y - known[0].y) / dt)
        if known is not None and known[0].header.incarnation == row.header.incarnation:
            self.rows_lost += row.header.seq - known[0].header.seq - 1
        self.rows_heard += 1
        if known is None:
            self._robots = None
        reported = row.progress
        if reported is not None and reported.route == self.route and (row.role is Role.LEADER or self.progress is None):
            self.progress = reported
        self._table[robot] = (row, at)
        vx, vy = self._velocity[robot]
        reach = self._reach[robot] = row.x, row.y, GOES_ON_S * abs(vx), GOES_ON_S * abs(vy)
        for wide_m, around in list(self._around.items()):
            if robot not in around.robots and around.may_hold(reach):
                del self._around[wide_m]
        self._clocks[robot].heard(row.header.stamp, at)

    def fresh_sensors(self, now: float) -> Sensors | None:
        return self.sensors if now - self.sensors_at <= self._sensors_s_max else None

    def pose_of(self, robot: int, now: float) -> Pose2D | None:
        """Return the pose of `robot` in `map`, extrapolated for `GOES_ON_S` at most; None when its row is stale, or
        says that it has none.
        """
        known = self._table.get(robot)
        if known is None or now - known[1] > ROW_S_MAX or not known[0].placed:
            return None
        row, (vx, vy), later = known[0], self._velocity[robot], min(now - known[1], GOES_ON_S)
        return Pose2D(row.x + vx * later, row.y + vy * later, row.theta)

    def velocity_of(self, robot: int) -> tuple[float, float]:
        """Return the velocity of `robot` in `map` [m/s] between its last two rows; zero where there are none."""
        return self._velocity.get(robot, (0.0, 0.0))

    def near(self, robots: Sequence[int], pose: Pose2D, within_m: float, now: float) -> list[tuple[int, Pose2D]]:
        """Return those of `robots` that may be within `within_m` of `pose`, in their order, each with its pose.

        Called at each control step: in a team of a hundred nearly all are passed over by the place in their last row.
        """
        x, y, reach, wide_m = pose.x, pose.y, self._reach, ceil(within_m) + AROUND_M
        around = self._around.get(wide_m)
        if around is None or around.of is not robots or not around.covers(x, y, within_m):
            around = self._around[wide_m] = self._look_around(robots, x, y, wide_m)
        nearby = [
            robot
            for robot in around.robots
            if abs((last := reach[robot])[0] - x) <= within_m + last[2] and abs(last[1] - y) <= within_m + last[3]
        ]
        return [(robot, place) for robot in nearby if (place := self.pose_of(robot, now)) is not None]

    def _look_around(self, robots: Sequence[int], x: float, y: float, wide_m: float) -> _Vicinity:
        """Return those of `robots` that are within `wide_m` of (x, y) [m], for as long as the robot stays there."""
        around = _Vicinity(robots, x, y, wide_m)
        around.robots = [one for one in robots if one in self._reach and around.may_hold(self._reach[one])]
        return around

    def poses(self, now: float) -> list[Pose2D | None]:
        """Return the poses in `map` of all robots in the table; None for a stale one."""
        return [self.pose_of(robot, now) for robot in self._table]

    def row_age(self, robot: int, now: float) -> float:
        """Return the time [s] since the last row of `robot`; infinite if there was none."""
        known = self._table.get(robot)
        return inf if known is None else now - known[1]

    def stuck(self, robot: int, now: float) -> bool:
        """Return whether `robot` reports that it is stuck; a stale report does not count."""
        known = self._table.get(robot)
        return known is not None and known[0].stuck and now - known[1] <= self.report_s_max

    def placeless(self, robot: int, now: float) -> bool:
        """Return whether `robot` reports that it has no pose; a stale report does not count."""
        known = self._table.get(robot)
        return known is not None and not known[0].placed and now - known[1] <= self.report_s_max

    def can_lead(self, robot: int, now: float) -> bool:
        """Return whether `robot` reports a pose, and is not stuck."""
        known = self._table.get(robot)
        return known is not None and known[0].placed and not known[0].stuck and now - known[1] <= self.report_s_max

    def delays(self, robots: tuple[int, ...], now: float) -> tuple[Delay, ...]:
        """Return the least (receive - send) of these robots' rows, for their half of a round trip (control.md 3.3)."""
        clocks = [(robot, self._clocks.get(robot)) for robot in robots]
        return tuple(Delay(robot, clock.least(now)) for robot, clock in clocks if clock is not None and clock.known)


def table_s(robots: int) -> float:
    """Return the time [s] between two rows of one robot in a team of that size."""
    return TABLE_S * max(1.0, robots / TABLE_ROBOTS_FULL_RATE)


def report_s_max(robots: int) -> float:
    """Return the age [s] up to which a row counts in a team of that size, but for its place: until well after the next
    one is due. A place that old is another one; but a team of 200 would count as unheard between its rows.
    """
    return max(ROW_S_MAX, table_s(robots) + ROW_SPARE_S)


def sensors_s_max(mission: Mission) -> float:
    """Return the age [s] beyond which the odometry of a robot with the control rate of `mission` is stale."""
    return max(SENSORS_S_MAX, SENSORS_PERIODS_MIN * mission.control_period_s)


class _Vicinity:
    """Those of the robots `of` that may be within `within_m` of a place, in their order: a few of a large team."""

    def __init__(self, of: Sequence[int], x: float, y: float, within_m: float) -> None:
        self.of = of
        self.within_m = within_m
        self._x, self._y = x, y
        self.robots: list[int] = []

    def may_hold(self, reach: tuple[float, float, float, float]) -> bool:
        """Return True if a robot with this place and extrapolation [m] belongs to them."""
        x, y, along_x, along_y = reach
        return abs(x - self._x) <= self.within_m + along_x and abs(y - self._y) <= self.within_m + along_y

    def covers(self, x: float, y: float, within_m: float) -> bool:
        """Return True if each robot that may be within `within_m` of (x, y) [m] is among them, rounding included."""
        return abs(x - self._x) + within_m < self.within_m - ROUNDING_M > abs(y - self._y) + within_m


def _overtaken(row: Header, known: Header, age_s: float) -> bool:
    """Return True if the row is from before the known one, which arrived `age_s` ago.

    Between incarnations that holds while the later one is fresh: a single stray number must not silence a robot (E23).
    """
    if row.incarnation == known.incarnation:
        return row.seq <= known.seq
    return is_later(known.incarnation, row.incarnation) and age_s <= ROW_S_MAX
