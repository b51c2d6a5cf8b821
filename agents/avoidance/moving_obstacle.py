"""Avoidance of moving obstacles: slow down, wait, or make room ahead, behind or to a side, by the predicted closest
approach (control.md section 7).

What crosses is let pass: slower or standing is enough. What comes along the robot's own way, from ahead or from behind,
meets it wherever it waits: then the motions of `EVASIONS` are compared by the distance that each would keep, as far as
the scan leaves them free.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot, inf

from lfa.agents.avoidance.decision import Action, Decision, Situation, decide
from lfa.agents.avoidance.evasion import (
    CLEARANCE_M,
    ESCAPES,
    EVASIONS,
    ONWARD,
    SLOW,
    Evasion,
    apart_m,
    care_of,
    closest_m,
    kept_m,
    leads_to,
    side_of,
)
from lfa.agents.avoidance.moving_points import AWAY_M
from lfa.agents.avoidance.safety import within
from lfa.agents.perception.obstacle_model import resting
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.agents.perception.scan import Point, free_along
from lfa.protocol.geometry import STILL, Pose2D, Twist, along_arc, in_base, slowed, wrap
from lfa.protocol.mission import Limits

LIMITS = Limits()
SLOW_SHARE, CRUISE_MPS = 0.4, 0.5
"""Share of the cruise speed [m/s] that a slowed robot drives at most. A share of what it wants would be taken again in
each step, since that grows from its last speed: it would crawl.
"""
WAIT_S_MAX = 5.0
"""Maximum waiting time [s]; afterwards a moving obstacle is driven around like a stationary one."""
SOON_S = 2.0
"""Time [s] ahead within which what comes on is given way to again, however long it was waited for."""
HOLD_S = 1.0
"""Time [s] after the last conflict before a robot may choose a less careful action."""
CALM_S = 3.0
"""Time [s] after the last conflict before a robot that waited is patient again: at rest it meets nothing, and would
wait anew for the same obstacle as soon as it drives on."""
WORTH_M, WORTH_CLOSE_M = 0.1, 0.05
"""Clearance [m] that another evasion must win over the present action, or over waiting; less where it comes close."""
USUAL_MPS = 0.5
"""Speed [m/s] beyond which that clearance grows in proportion: where something fast comes by is less certain."""
BODY_M = 0.05
"""Clearance [m] to what stands that an evasion keeps beside the body."""
ROOM_S = 1.2
"""Time [s] for which an evasion has to be free of what stands."""
MATE_M, MATE_S, MATES_WITHIN_M = 0.15, 1.5, 2.0
"""Room [m] between two bodies, and time [s] ahead, that an evasion keeps from team-mates, which evade as well, and the
distance [m] of those that are looked at."""
DRIVEN_M = 0.3
"""Clearance [m] that backing off must keep beyond the others: what comes after a robot that backs off drives it on."""
CLOSE_M, CLOSE_S = 0.35, 1.0
"""Room [m] to what comes on below which the way that it means to pass by does not count any more, for it may turn, and
the time [s] within which the robot makes as much room as it can, whether it turns or goes on."""
GOES_SHARE = 0.3
"""Cosine of the angle off the direction away from the robot up to which what moves goes away."""
WARY_S, WARY_M = 0.8, 0.1
"""Time [s] within which what moves, if it turns towards a robot that drives on, must not come nearer than this [m]."""

Mates = Callable[[Pose2D, float, float], Sequence[Feature]]
"""Function that returns the team-mates within a distance [m] of a pose, at a time [s], with their radius as 0."""


class Crossing:
    """Give-way behaviour of one robot towards moving obstacles, for a bounded time."""

    def __init__(self, radius_m: float = 0.15, cruise_mps: float = CRUISE_MPS, limits: Limits = LIMITS) -> None:
        self._radius_m = radius_m
        self._limits = limits
        self._slow_mps = SLOW_SHARE * cruise_mps
        self._evasion, self._heading, self._last = SLOW, 0.0, STILL
        self.decision: Decision | None = None
        self._waiting_since: float | None = None
        self._held_until = 0.0
        self._near = inf
        """Closest approach [m] in the last conflict."""
        self._impatient = False
        self._conflict_at = self._side_at = -inf
        """Times [s] of the last conflict, and of the last bend to another side than the one before."""

    @property
    def patient(self) -> bool:
        """False after the longest wait: a moving obstacle is then driven around like a stationary one."""
        return not self._impatient

    def give_way(
        self,
        moving: Sequence[Feature],
        pose: Pose2D,
        wanted: Twist,
        now: float,
        points: Sequence[Point] = (),
        mates: Mates = lambda _pose, _within_m, _now: (),
        last: Twist = STILL,
    ) -> Twist:
        """Return `wanted`, or a slower or evading twist. `moving` holds as of now, in `map` like `pose`; `points` are
        those of the scan, in `base_link`; `mates` is asked where room is made; `last` is the last command.
        """
        self._last = last
        near = self._nearest_m(moving, pose, wanted)
        if near >= CLEARANCE_M and now >= self._held_until:
            self.decision, self._evasion = None, SLOW
            if not moving or now - self._conflict_at >= CALM_S:
                self._waiting_since, self._impatient = None, False
            return self._wary(moving, pose, wanted)
        self._conflict_at = now
        self._near = near if near < CLEARANCE_M else self._near
        if self._waiting_since is None:
            self._waiting_since = now
        self._impatient = now - self._waiting_since > WAIT_S_MAX
        if self._impatient and closest_m(moving, pose, wanted, SOON_S) < self._radius_m + AWAY_M:
            self._impatient, self._waiting_since = False, now  # what was waited for comes on
        if self._impatient:
            self.decision = None
            return wanted
        evasion = (
            SLOW
            if near >= CLEARANCE_M
            else self._less(moving, pose, wanted, points, mates(pose, MATES_WITHIN_M, now), now)
        )
        if self.decision is None or care_of(evasion.action) >= care_of(self.decision.action) or now >= self._held_until:
            row = decide(Situation("moving", near, closest_m=min(near, self._near)))
            named = ("", "") if row is None else (row.name, row.updates)
            self.decision = Decision(evasion.action, near, 0.0, "moving", *named)
            self._held_until = now + HOLD_S if near < CLEARANCE_M else self._held_until
            if evasion != self._evasion:
                if evasion.turn_rad and not (self._evasion.turn_rad and side_of(evasion) == side_of(self._evasion)):
                    self._side_at = now
                self._evasion, self._heading = evasion, wrap(pose.theta + evasion.turn_rad * side_of(evasion))
        if self._evasion.action not in (Action.WAIT, Action.BACK):
            self._waiting_since = now  # a robot that drives on or makes room does not wait
        twist = self._done(self._present(pose), wanted)
        if self._evasion.action not in ONWARD:  # out of the way of one, but not into another that may turn
            moving = [feature for feature in moving if feature.keeps_s < inf and leads_to(feature, pose, twist)]
        return self._wary(moving, pose, twist)

    def _nearest_m(self, moving: Sequence[Feature], pose: Pose2D, twist: Twist) -> float:
        """Return the least distance [m] to what moves within the horizon. What turns again and again counts only where
        it would touch soon, or is close already: nobody knows where it will be, and waiting for it does not end.
        """
        near = closest_m([feature for feature in moving if feature.keeps_s == inf], pose, twist)
        for feature in moving:
            if feature.keeps_s < inf:
                soon = closest_m((feature,), pose, twist, SOON_S)
                if soon < self._radius_m + AWAY_M or self._comes_close(feature, pose):
                    near = min(near, soon, apart_m((feature,), pose, 0.0))
        return near

    def _wary(self, moving: Sequence[Feature], pose: Pose2D, twist: Twist) -> Twist:
        """Return `twist`, slowed towards what it comes nearer to, so that this may turn and not meet the robot within
        `WARY_S`.
        """
        for feature in moving:
            x, y = in_base(pose, (feature.x, feature.y))
            off_m = max(hypot(x, y), 1e-6)
            ahead = (x if twist.linear_x >= 0.0 else -x) / off_m
            away_mps = ((feature.x - pose.x) * feature.vx + (feature.y - pose.y) * feature.vy) / off_m
            if ahead > 0.0 and abs(twist.linear_x) * ahead > away_mps:
                speed = hypot(feature.vx, feature.vy)
                room_m = off_m - feature.radius_m - self._radius_m - WARY_M - WARY_S * speed
                twist = slowed(twist, max(0.0, room_m, WARY_S * away_mps) / (WARY_S * ahead))
        return twist

    def _present(self, pose: Pose2D) -> Evasion:
        """Return what is left of the present evasion: its bend ends at the heading that it was chosen for."""
        evasion = self._evasion
        if not evasion.turn_rad:
            return evasion
        left_rad = max(0.0, side_of(evasion) * wrap(self._heading - pose.theta))
        return Evasion(evasion.action, evasion.v_mps, evasion.omega_radps if left_rad > 0.0 else 0.0, left_rad)

    def _comes_close(self, feature: Feature, pose: Pose2D) -> bool:
        """Return whether an obstacle is so near that it reaches the robot if it turns towards it, and does not go."""
        off_m = hypot(feature.x - pose.x, feature.y - pose.y)
        return not _goes(feature, pose) and off_m < feature.radius_m + self._radius_m + CLOSE_M

    def _less(
        self,
        moving: Sequence[Feature],
        pose: Pose2D,
        wanted: Twist,
        points: Sequence[Point],
        mates: Sequence[Feature],
        now: float,
    ) -> Evasion:
        """Return the least action that keeps the distance; if none does, the one that keeps most of it."""
        if self._nearest_m(moving, pose, self._done(SLOW, wanted)) >= CLEARANCE_M:
            return SLOW
        if self._nearest_m(moving, pose, STILL) >= CLEARANCE_M:
            return EVASIONS[0]
        best, most, points = EVASIONS[0], -inf, resting(list(points), pose, moving)
        fastest = max(hypot(feature.vx, feature.vy) for feature in moving)
        close = [feature for feature in moving if self._comes_close(feature, pose)]
        here = [feature for feature in moving if not _goes(feature, pose)]
        under_way = self.decision is not None and self._evasion is not SLOW
        candidates = (*EVASIONS, *ESCAPES) if close else EVASIONS
        candidates = (self._present(pose), *candidates) if under_way else candidates
        keeps_side = bool(self._evasion.turn_rad) and now - self._side_at < HOLD_S and not close
        for evasion in candidates:
            if keeps_side and evasion.turn_rad and side_of(evasion) != side_of(self._evasion):
                continue
            twist = self._done(evasion, wanted)
            if twist.linear_x and free_along(points, twist, self._radius_m + BODY_M) < abs(twist.linear_x) * ROOM_S:
                continue
            if twist.linear_x and closest_m(mates, pose, twist, MATE_S) < 2.0 * self._radius_m + MATE_M:
                continue
            if any(leads_to(feature, pose, twist) for feature in close):
                continue  # it would be braked, and met on its way past
            if close:
                place = self._soon(pose, twist)
                kept = min(apart_m(here, place, 0.5 * CLOSE_S), apart_m(here, place, CLOSE_S))
            else:
                kept = kept_m(moving, pose, evasion, twist)
                kept -= DRIVEN_M if evasion.v_mps < 0.0 else 0.0
            if evasion is candidates[0]:  # the present one, or waiting
                kept += WORTH_CLOSE_M if close else WORTH_M * max(1.0, fastest / USUAL_MPS)
            if kept > most:
                best, most = evasion, kept
        return self._evasion if under_way and best is candidates[0] else best

    def _soon(self, pose: Pose2D, twist: Twist) -> Pose2D:
        """Return the pose after `CLOSE_S` of `twist`, which the drive reaches from its last speed step by step."""
        before = self._last.linear_x
        lag_s = min(0.5 * abs(twist.linear_x - before) / self._limits.a_max_mps2, CLOSE_S)
        return along_arc(along_arc(pose, Twist(before, twist.angular_z), lag_s), twist, CLOSE_S - lag_s)

    def _done(self, evasion: Evasion, wanted: Twist) -> Twist:
        """Return the twist of an evasion, as the drive can do it, where `wanted` is the motion without it."""
        if evasion is SLOW:
            return slowed(wanted, self._slow_mps)
        v = max(wanted.linear_x, evasion.v_mps) if evasion.action is Action.AHEAD else evasion.v_mps
        return Twist(*within(Twist(v, evasion.omega_radps), self._limits))


def _goes(feature: Feature, pose: Pose2D) -> bool:
    """Return whether what moves goes away from a robot at `pose`."""
    x, y, speed = feature.x - pose.x, feature.y - pose.y, hypot(feature.vx, feature.vy)
    return x * feature.vx + y * feature.vy > GOES_SHARE * hypot(x, y) * speed
