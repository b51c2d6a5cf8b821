"""Motion of a leader: the mission's motion, slowed for the team behind it.

The mission chooses the motion (along a route, to a point, by a timetable, reactively, through unknown ground). The
slowing that lets the team keep up is the same for all (control.md sections 2.2 and 7).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot
from typing import TYPE_CHECKING, Any

from lfa.agents.avoidance.decision import Decision
from lfa.agents.following.factory import heading_filter_of
from lfa.agents.formation.formation import Formation
from lfa.agents.leading.free_place import FREE_WITHIN_M, FreePlace
from lfa.agents.leading.path_follower import PathFollower
from lfa.agents.perception.scan import Point, without
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import Pose2D, Twist, distance, in_base
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Mission

if TYPE_CHECKING:
    from lfa.agents.exploration.explorer import Explore
    from lfa.agents.leading.planned_way import PlannedWay
    from lfa.agents.leading.timed_route import Timetable
    from lfa.agents.leading.way_round import WayRound

GAP_SLOW = 1.5
GAP_WAIT = 2.0
"""Gaps of the chain, in units of k^d, from which the leader slows, down to half its speed, and above which it waits."""
GAP_WAIT_S_MAX = 15.0
LOOK_M = 2.0
LEADER_OMEGA_MAX_RADPS = 0.6
"""Maximum turn rate of a leader: a slot at k^d = 1.2 m then swings at 0.7 m/s."""
SWING_S, SWING_SHARE = 10.0, 0.7
"""Time [s] after an orientation request, and the share of its cruise speed that the leader drives during it."""
DETOUR_SHARE = 0.7
LEFT_M, BACK_M = 0.5, 0.15
"""Distances [m] from the route beyond which a leader has left it, and within which it is back on it."""


class Leadership:
    """Leading behaviour of one robot; `begin` starts its term as leader."""

    def __init__(self, mission: Mission, formation: Formation, team: TeamState) -> None:
        self._mission = mission
        self.formation = formation
        self._team = team
        swings = (
            heading_filter_of(mission) == 0.0
        )  # behind a filter a slot follows what this robot drives, not its turns
        self.lead = PathFollower(
            mission.leading, mission.limits, mission.radius_m, mission.control_period_s, slots_swing=swings
        )
        self._planned: PlannedWay | None = None
        self._round: WayRound | None = None
        """Way round the present trap; None before the first one."""
        self._timetable: Timetable | None = None
        if mission.leading.motion == "explore":
            # Imported here: only explorers pay the memory of a map and a planner.
            from lfa.agents.leading.planned_way import PlannedWay

            self._planned = PlannedWay(mission)
            self.lead = self._planned.lead
        elif mission.leading.motion == "trajectory":
            from lfa.agents.leading.timed_route import Timetable

            self._timetable = Timetable(mission.leading)
        self._free_place = FreePlace(mission.radius_m)
        self._looked_at = -1
        self._events: list[tuple[str, dict[str, Any]]] = []
        self._off_max_m: float | None = None
        """Largest distance [m] from the route since the leader left it; None on the route."""
        self.failure: str | None = None
        """Reason why the goal cannot be reached; None: none is known."""
        self._waiting_since: float | None = None
        self._asked: dict[int, float] = {}
        self._swings_until = 0.0
        self.waited_out = False
        """True when the leader has waited for its team for the longest time allowed."""
        self._speed_mps = 0.0
        self._slots: list[Slot] = []
        self._alone = False

    @property
    def explore(self) -> Explore | None:
        """Map and planner of an explorer, or of a leader on its way round a trap; otherwise None."""
        return None if self._way is None else self._way.explore

    @property
    def rounding(self) -> bool:
        """True on a planned way round a trap."""
        return self._round is not None and self._round.way is not None

    @property
    def _way(self) -> PlannedWay | None:
        return self._planned if self._planned is not None or self._round is None else self._round.way

    @property
    def under_way(self) -> bool:
        """True while the leader should move: it has a target, and neither its team nor its timetable lets it wait."""
        return self._speed_mps > 0.0 and (self.explore is None or bool(self.explore.route))

    @property
    def plans(self) -> bool:
        """True while the leader should move, and has no way yet."""
        return self._speed_mps > 0.0 and self.explore is not None and not self.explore.route

    @property
    def waiting(self) -> bool:
        """True while the leader stands until its team catches up."""
        return self._waiting_since is not None and not self.waited_out

    def pace(self, mission: Mission) -> None:
        """Go on at the control rate of `mission`, which differs in nothing else."""
        self._mission = mission
        self.lead.period_s = mission.control_period_s
        if self._way is not None:
            self._way.lead.period_s = mission.control_period_s

    def begin(self, pose: Pose2D, driven_m: float, now: float) -> None:
        """Start leading at `pose`, from the progress that the team has made; `driven_m` is the own odometer."""
        self._waiting_since, self.waited_out = None, False
        self._round = None
        self.lead.begin(pose, self._team.progress, driven_m)
        if self._timetable is not None:
            self._timetable.begin(self.lead.waypoints_m, self.lead.place_m, now)

    def see(self, scan: LaserScan, pose: Pose2D, twist: Twist, mates: Sequence[Pose2D]) -> None:
        """Update the map with a scan, where there is one."""
        if self.explore is not None:
            self.explore.see(scan, pose, twist, mates)

    def work(self, leads: bool, pose: Pose2D, mates: Callable[[float], Sequence[Pose2D]], now: float) -> None:
        """Do one step's share of mapping and planning, where the ground is unknown."""
        if self._planned is not None and leads:
            self._planned.explore.aim(self.lead.waypoint)
        if self._way is not None:
            self._way.work(leads, pose, mates(now), now)
        if self._planned is not None and self._planned.explore.failure is not None:
            self.failure = self._planned.explore.failure

    def step(self, chain: tuple[int, ...], pose: Pose2D, last: Twist, now: float) -> tuple[Twist, float]:
        """Return the wanted twist, and the maximum speed [m/s] of a detour."""
        slots = [] if self.formation.trace else [self.formation.slot_of(robot) for robot in chain[1:]]
        self._slots, self._alone = slots, len(chain) == 1
        speed = self._mission.leading.cruise_mps
        if self._timetable is not None:
            speed = self._timetable.speed(self.lead.place_m, now)
        speed *= self._patience(chain, pose, now) * self._swing(slots, now)
        self._speed_mps = speed
        wanted = self.lead.step(pose, last, slots, speed)
        self._tell_detour(self.lead.off_m(pose))
        return wanted, DETOUR_SHARE * speed

    def look(self, points: list[Point], pose: Pose2D, now: float) -> list[Point]:
        """Look whether something stands on the next way-point, and choose the free place beside it.

        Return the points of the scan to make a detour for, which are all but those of that thing.
        """
        lead = self.lead
        if lead.waypoint_number != self._looked_at:
            self._looked_at = lead.waypoint_number
            self._free_place.reset()
        number, (x, y) = lead.waypoint_number, self._mission.leading.route_m[lead.waypoint_number]
        if lead.drives_up:
            place = self._free_place.look((x, y), points, pose, now)
            if place is not None and lead.place is None:
                lead.end_at(place)
                self._events.append(("waypoint_taken", {"waypoint": number, "x": place[0], "y": place[1]}))
            elif self._free_place.none_left:
                self._pass_over(number)
        if lead.place is None:
            return points
        return without(points, in_base(pose, (x, y)), hypot(lead.place[0] - x, lead.place[1] - y))

    def drain(self) -> list[tuple[str, dict[str, Any]]]:
        """Return what has happened on the route since the last call, as kinds and data of events."""
        passed = [("waypoint", {"waypoint": n, "off_m": round(off_m, 3)}) for n, off_m in self.lead.passed]
        passed_on, self._events = [*passed, *self._events], []
        self.lead.passed.clear()
        return passed_on

    def _tell_detour(self, off_m: float) -> None:
        """Tell when the leader has left its route by more than `LEFT_M`, and when it is back on it."""
        if self._off_max_m is None and off_m > LEFT_M:
            self._events.append(("route", {"state": "left", "off_m": round(off_m, 3)}))
            self._off_max_m = off_m
        elif self._off_max_m is not None:
            self._off_max_m = max(self._off_max_m, off_m)
            if off_m < BACK_M:
                self._events.append(("route", {"state": "back", "off_max_m": round(self._off_max_m, 3)}))
                self._off_max_m = None

    def _pass_over(self, number: int) -> None:
        """Give up a way-point that something stands on without a free place beside it: the run, if it is the goal."""
        reason = f"something stands on way-point {number + 1}, and no place within {FREE_WITHIN_M:g} m of it is free"
        if self.lead.is_last:
            self.failure = reason
        else:
            self._events.append(("waypoint_skipped", {"waypoint": number, "reason": reason}))
            self.lead.skip()

    def target(self, pose: Pose2D) -> Point:
        """Return the point in `base_link` to which a detour leads back."""
        return self.lead.ahead(pose, min(LOOK_M, self.lead.remaining_m(pose)))

    def planned(
        self, points: list[Point], pose: Pose2D, wanted: Twist, last: Twist, local: Decision | None, now: float
    ) -> Twist | None:
        """Return the twist of the planned way, that of an explorer or one round a trap; None when there is none.

        `wanted` and `last` are the twists of `step` and of the last command, `local` is the decision of the detour.
        """
        if self._planned is not None:
            return self._planned.follow(points, pose, wanted, now, alone=not self._slots)
        if self._round is None:
            if local is None:
                return None
            # Imported here: only a leader that meets an obstacle pays the memory.
            from lfa.agents.leading.way_round import WayRound

            self._round = WayRound(self._mission, self.lead)
        self._round.watch(local, now, alone=self._alone)
        return self._round.steer(points, pose, last, self._slots, self._speed_mps, now)

    def _swing(self, slots: Sequence[Slot], now: float) -> float:
        """Return the share of the cruise speed while the formation opens: the last slot swings with all before it.

        Falling back into column needs no slowing: the slots swing to the rear, and only lag.
        """
        asked = {slot.robot: slot.phi for slot in slots}
        for robot, phi in asked.items():
            before = self._asked.get(robot, phi)
            if phi != before and abs(phi) <= abs(before):
                self._swings_until = now + SWING_S
        self._asked = asked
        return SWING_SHARE if now < self._swings_until else 1.0

    def _patience(self, chain: tuple[int, ...], pose: Pose2D, now: float) -> float:
        """Return the share of the cruise speed that lets the team keep up: less at a wide gap, 0 for a bounded time."""
        ahead: Pose2D | None = pose
        widest = 0.0
        for robot in chain[1:]:
            here = self._team.pose_of(robot, now)
            if here is not None and ahead is not None:
                widest = max(widest, distance(ahead, here) / self.formation.slot_of(robot).separation_m)
            ahead = here
        if widest <= GAP_WAIT:
            self._waiting_since, self.waited_out = None, False
            return 1.0 - 0.5 * max(0.0, widest - GAP_SLOW) / (GAP_WAIT - GAP_SLOW)
        if self._waiting_since is None:
            self._waiting_since = now
        self.waited_out = now - self._waiting_since >= GAP_WAIT_S_MAX
        return 0.5 if self.waited_out else 0.0
