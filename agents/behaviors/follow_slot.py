"""Behaviour of a follower: its law in the slot, a detour, a planned way back, or a place beside a taken slot."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, inf, sin
from typing import TYPE_CHECKING

from lfa.agents.avoidance.decision import Action, Decision
from lfa.agents.avoidance.detour import Detour
from lfa.agents.behaviors.make_room import ROOM, MakeRoom
from lfa.agents.behaviors.team_mates import TeamMates
from lfa.agents.following.factory import heading_filter_of
from lfa.agents.following.follower import Follower
from lfa.agents.following.predecessor import Sighting
from lfa.agents.following.swung_slot import SwungSlot
from lfa.agents.leading.free_slot import FreeSlot
from lfa.agents.leading.leader import Leadership
from lfa.agents.perception.obstacle import ON_THE_MAP
from lfa.agents.perception.obstacle_model import ObstacleModel
from lfa.agents.perception.own_readings import OwnReadings
from lfa.agents.perception.scan import Point, without
from lfa.protocol.geometry import Pose2D, Twist, in_base
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Mission

if TYPE_CHECKING:
    from lfa.agents.leading.way_back import WayBack

CATCH_UP_PER_S = 0.8
SLOT_AHEAD_S, SLOT_AHEAD_SHARE = 2.0, 0.4
"""Time [s] by which the target of a follower's detour is ahead on its slot's motion, and the share of k^d that limits
this distance: farther ahead the predecessor would block the way."""
ON_TRACE_M = 0.3
"""Distance [m] to its place on a trace below which a follower makes no detour: its predecessor's path is better."""
BESIDE_SLOT_SHARE = 0.45
"""Distance of a place beside a slot that is taken, as a share of k^d, at most; it still counts as in its slot."""
BESIDE_PREDECESSOR_M = 0.1
FRESH_S = 0.5
RESTS_MPS, BARS_SHARE = 0.01, 0.5
"""Speed [m/s] of a predecessor at rest, and cosine of the angle between the ways to it and from it to the slot above
which it stands between: the law keeps its distance there, and the detour leads round obstacles, not round it."""
WAY_BACK = Decision(Action.PLAN_ROUND, inf, 0.0, "wall", "the slot is out of reach of a detour", "angle")
"""Decision of a follower that plans its way back to its slot, for the log."""


class FollowSlot:
    """Following behaviour of one robot. `detour` holds the present decision, and is shared with the leader's."""

    def __init__(
        self,
        mission: Mission,
        follower: Follower,
        detour: Detour,
        obstacles: ObstacleModel,
        mates: TeamMates,
        leading: Leadership,
        own_readings: OwnReadings,
    ) -> None:
        self._mission = mission
        self._follower = follower
        self._detour = detour
        self._obstacles = obstacles
        self._mates = mates
        self._formation = leading.formation
        self._leading = leading
        self._own_readings = own_readings
        self._free_slot = FreeSlot(mission.radius_m)
        self._swung_slot = SwungSlot(mission.radius_m)
        self._filters_heading = heading_filter_of(mission) > 0.0
        self._make_room = MakeRoom(mission.radius_m)
        self._ahead: int | None = None
        """Number of the predecessor that these know."""
        self._way_back: WayBack | None = None
        """Way back to the slot; None before this follower has lost it for the first time."""

    def end(self) -> None:
        """Give up a planned way, another slot and the room that it makes: the robot has another role."""
        self._begin_behind(None)
        if self._way_back is not None:
            self._way_back.end()

    def _begin_behind(self, robot: int | None) -> None:
        """Forget what holds for the last predecessor only."""
        self._ahead = robot
        self._free_slot.end()
        self._swung_slot.end()
        self._make_room.end()

    @property
    def catches_up(self) -> bool:
        """True on a planned way back to the slot."""
        return self._way_back is not None and self._way_back.way is not None

    def see(self, scan: LaserScan, pose: Pose2D, twist: Twist, mates: Sequence[Pose2D]) -> None:
        """Update the map of a way back with a scan."""
        if self._way_back is not None:
            self._way_back.see(scan, pose, twist, mates)

    def step(
        self, points: list[Point], pose: Pose2D, twist: Twist, last: Twist, dt: float, now: float, *, stuck: bool
    ) -> Twist:
        """Return the twist of the law, or that of a way to the slot where obstacles lie between. `points` are what
        stands, in `base_link`.
        """
        ahead, trace = self._mates.predecessor, self._formation.trace
        sighting, slot = None if ahead is None else ahead.at(now), self._formation.slot_of(self._mates.own_id)
        if ahead is not None and ahead.robot != self._ahead:
            self._begin_behind(ahead.robot)
        if sighting is not None:
            slot = self._swung(slot, sighting, points, pose, now)
            trace = trace and not self._swung_slot.is_swung
        self._follower.own_readings = self._own_readings.at(now)
        wanted = self._follower.step(sighting, slot, pose, twist, dt, on_trace=trace)
        if sighting is None or sighting.age_s > FRESH_S:
            return wanted
        room = self._make_room.step(sighting, points, pose, now)
        if room is not None:
            self._detour.decision = ROOM
            return room
        if self._detour.decision is ROOM:
            self._detour.decision = None
            self._follower.rejoin(pose, last)
        if trace and self._follower.readout.error_m < ON_TRACE_M:
            return wanted
        place = self._follower.readout.slot_map
        barred = stuck or _bars(sighting, (place.x, place.y), pose)
        back = self._catch_up((place.x, place.y), points, pose, last, now, barred=barred)
        if back is not None:
            return back
        ahead_mps, within_m = sighting.twist.linear_x, BESIDE_SLOT_SHARE * slot.separation_m
        hindered = self._detour.decision is not None
        beside = self._free_slot.steer((place.x, place.y), points, pose, ahead_mps, within_m, now, hindered=hindered)
        if beside is not None:
            self._detour.decision = None
            return beside
        return self._around(sighting, slot, points, pose, wanted, last, now)

    def _swung(self, slot: Slot, sighting: Sighting, points: list[Point], pose: Pose2D, now: float) -> Slot:
        """Return `slot`, swung to a free place where this robot cannot get to it."""
        readout, within_m = self._follower.readout, BESIDE_SLOT_SHARE * slot.separation_m
        chi = readout.chi if self._filters_heading else sighting.pose.theta
        return self._swung_slot.swung(
            slot, (readout.slot_map.x, readout.slot_map.y), sighting.pose, chi, sighting.twist.linear_x, points, pose,
            within_m, now,
        )  # fmt: skip

    def _around(
        self,
        sighting: Sighting,
        slot: Slot,
        points: list[Point],
        pose: Pose2D,
        wanted: Twist,
        last: Twist,
        now: float,
    ) -> Twist:
        """Return the twist of a detour to the slot's future place: in the slot itself its direction is undefined."""
        place, ahead_mps = self._follower.readout.slot_map, sighting.twist.linear_x
        speed = abs(ahead_mps) + CATCH_UP_PER_S * hypot(place.x - pose.x, place.y - pose.y)
        speed = min(self._mission.limits.v_max_mps, speed)
        ahead_m = min(SLOT_AHEAD_S * ahead_mps, SLOT_AHEAD_SHARE * slot.separation_m)
        target = in_base(pose, (place.x + ahead_m * cos(place.theta), place.y + ahead_m * sin(place.theta)))
        was_detour = self._detour.decision is not None
        if not was_detour:
            body_m = self._mission.radius_m + BESIDE_PREDECESSOR_M
            points = without(points, in_base(pose, (sighting.pose.x, sighting.pose.y)), body_m)
        around = self._detour.steer(
            points, target, wanted, speed, now, lambda free_m: self._obstacles.blocking(pose, wanted, free_m, now)
        )
        if around is None and was_detour:
            self._follower.rejoin(pose, last)
        return wanted if around is None else around

    def _catch_up(
        self,
        slot: Point,
        points: list[Point],
        pose: Pose2D,
        last: Twist,
        now: float,
        *,
        barred: bool,
    ) -> Twist | None:
        """Return the twist of a planned way back to `slot` in `map`; None while the follower needs none. `barred` where
        it is hindered, whatever the detour says.
        """
        decision = self._detour.decision
        hindered = barred or (decision is not None and decision.kind in ON_THE_MAP)
        if self._way_back is None:
            if not hindered:
                return None
            # Imported here: only a follower that meets an obstacle pays the memory.
            from lfa.agents.leading.way_back import WayBack

            self._way_back = WayBack(self._mission)
        was_back, explore = self.catches_up, self._leading.explore
        self._way_back.watch(slot, pose, hindered, None if explore is None else explore.mapping, now)
        twist = self._way_back.steer(points, pose, slot, self._mates.places, last, now)
        if twist is not None:
            self._detour.decision = WAY_BACK
        elif was_back:
            self._detour.decision = None
            self._follower.rejoin(pose, last)
        return twist


def _bars(sighting: Sighting, slot: Point, pose: Pose2D) -> bool:
    """Return whether the predecessor rests between a robot at `pose` and its `slot` (in `map`)."""
    ahead = sighting.pose
    px, py, sx, sy = ahead.x - pose.x, ahead.y - pose.y, slot[0] - ahead.x, slot[1] - ahead.y
    return abs(sighting.twist.linear_x) < RESTS_MPS and px * sx + py * sy > BARS_SHARE * hypot(px, py) * hypot(sx, sy)
