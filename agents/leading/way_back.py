"""Way back of a follower that has fallen behind: round what its detour does not lead round, to its slot.

A follower's detour aims straight at its slot. Where the team has driven round a wall, a door has shut, or a pocket lies
between, it would turn back and forth there. A follower that is out of its slot and wins nothing plans a way to it on a
map, like a leader round a trap (`way_round.py`); the map is kept only that long.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, hypot, inf

from msgspec.structs import replace

from lfa.agents.avoidance.openings import NARROW_M, barring_point
from lfa.agents.exploration.occupancy_grid import Mapping
from lfa.agents.leading.planned_way import PlannedWay
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import Pose2D, Twist, in_base
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.mission import Mission

PATIENCE_S, WON_M = 5.0, 0.5
"""Time [s] out of its slot in which a follower comes nearer to it by less than this [m], before it plans a way."""
OUT_M = 1.0
"""Distance [m] from the slot beyond which a follower is out of it."""
BACK_M = 0.7
"""Distance [m] from the slot within which, with nothing between, the follower's law takes over again."""
CLOSE_M = 0.25
"""Distance [m] from the slot within which it does so in any case; within `BACK_M` also where a team-mate stands on the
slot: a place beside that is a matter of `free_slot.py`, and no way leads there."""
CALM_S = 5.0
"""Time [s] after a way that was not found before another is planned."""
CRUISE_SHARE = 0.8
"""Share of the drive's speed and acceleration with which a follower catches up."""


class WayBack:
    """Way back of one follower: `way` from where it has lost its slot until it is there again, else None."""

    def __init__(self, mission: Mission) -> None:
        limits = mission.limits
        leading = replace(
            mission.leading,
            cruise_mps=CRUISE_SHARE * limits.v_max_mps,
            acceleration_mps2=CRUISE_SHARE * limits.a_max_mps2,
        )
        self._mission = replace(mission, leading=leading)
        self._won: tuple[float, float] | None = None
        """Time [s] and least distance [m] to the slot when the follower last came nearer to it."""
        self._not_before = -inf
        self._shares_map = False
        self.way: PlannedWay | None = None

    def end(self) -> None:
        """Forget the way: the follower is in its slot again, or has another role."""
        self.way, self._won = None, None

    def see(self, scan: LaserScan, pose: Pose2D, twist: Twist, mates: Sequence[Pose2D]) -> None:
        """Update the map with a scan, where this way has a map of its own."""
        if self.way is not None and not self._shares_map:
            self.way.explore.see(scan, pose, twist, mates)

    def watch(self, slot: Point, pose: Pose2D, hindered: bool, mapping: Mapping | None, now: float) -> None:
        """Begin a way when a follower that is out of its `slot` (in `map`) wins nothing. `hindered` is False while it
        makes no detour and does not stand in a jam; `mapping` is the map that the robot keeps anyway, if any.
        """
        apart_m = hypot(slot[0] - pose.x, slot[1] - pose.y)
        if self.way is not None:
            return
        if apart_m < OUT_M or not hindered or now < self._not_before:
            self._won = None
        elif self._won is None or apart_m <= self._won[1] - WON_M:
            self._won = now, apart_m
        elif now - self._won[0] >= PATIENCE_S:
            self._shares_map = mapping is not None
            self.way = PlannedWay(self._mission, slot, mapping)

    def steer(
        self,
        points: list[Point],
        pose: Pose2D,
        slot: Point,
        mates: Callable[[float], Sequence[Pose2D]],
        last: Twist,
        now: float,
    ) -> Twist | None:
        """Return the twist of the way back; None when there is none, or when it has ended. `points` are in
        `base_link`.
        """
        way = self.way
        if way is None:
            return None
        way.chase(slot)
        places = mates(now)
        way.work(True, pose, places, now)
        x, y = in_base(pose, slot)
        near_m = hypot(x, y)
        half_width_m = self._mission.radius_m + NARROW_M
        taken = any(hypot(mate.x - slot[0], mate.y - slot[1]) < 2.0 * half_width_m for mate in places)
        free = near_m <= BACK_M and (taken or barring_point(points, atan2(y, x), near_m, half_width_m) is None)
        there = near_m <= CLOSE_M or free
        if there or way.explore.failure is not None:
            self._not_before = -inf if there else now + CALM_S
            self.end()
            return None
        return way.follow(
            points, pose, way.lead.step(pose, last, (), self._mission.leading.cruise_mps), now, alone=True
        )
