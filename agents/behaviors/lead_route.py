"""Behaviour of a leader: its motion, a detour, or a planned way; or an operator's hand."""

from __future__ import annotations

from functools import partial
from math import inf

from lfa.agents.avoidance.decision import Action, Decision
from lfa.agents.avoidance.detour import Detour
from lfa.agents.leading.hand_driving import HandDriving
from lfa.agents.leading.leader import Leadership
from lfa.agents.leading.narrow_gap import narrow_gap_m
from lfa.agents.perception.obstacle_model import ObstacleModel
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.mission import Mission

ROUND_TRAP = Decision(Action.PLAN_ROUND, inf, 0.0, "wall", "no local way leads on", "angle")
"""Decision of a leader whose detour leads nowhere, for the log."""
MEANT_MPS = 0.05
"""Least speed [m/s] by which a leader's way is judged: where it is held at rest, the ramp of its acceleration begins
anew in each step, and what it wants never tells how far it means to drive."""


class LeadRoute:
    """Leading behaviour of one robot; `leading` chooses the motion, `detour` holds the present decision."""

    def __init__(
        self, leading: Leadership, detour: Detour, obstacles: ObstacleModel, mission: Mission, hand: HandDriving
    ) -> None:
        self._leading = leading
        self._detour = detour
        self._obstacles = obstacles
        self._mission = mission
        self._hand = hand
        self.by_hand = False
        """True while an operator drives this leader."""

    def step(
        self, chain: tuple[int, ...], points: list[Point], pose: Pose2D, last: Twist, odometer_m: float, now: float
    ) -> Twist:
        """Return the wanted twist of the leader of `chain`; `points` are what stands, in `base_link`. After an operator
        has driven it, the route begins anew at `pose` and `odometer_m`.
        """
        by_hand = self._hand.wanted(self._mission.limits, now)
        if by_hand is not None:
            self._detour.decision, self.by_hand = None, True
            return by_hand
        if self.by_hand:
            self._leading.begin(pose, odometer_m, now)
            self.by_hand = False
        return self._drive(chain, points, pose, last, now)

    def _drive(self, chain: tuple[int, ...], points: list[Point], pose: Pose2D, last: Twist, now: float) -> Twist:
        around_these = self._leading.look(points, pose, now)
        wanted, speed = self._leading.step(chain, pose, last, now)
        planned = self._leading.planned(points, pose, wanted, last, self._detour.decision, now)
        if planned is not None:
            if self._leading.rounding:
                self._detour.decision = ROUND_TRAP
            return planned
        target, meant = self._leading.target(pose), _meant(wanted)
        around = self._detour.steer(
            around_these, target, meant, speed, now, lambda free_m: self._obstacles.blocking(pose, meant, free_m, now)
        )
        return wanted if around is None else around

    def narrow_ahead(self, pose: Pose2D) -> str | None:
        """Return the reason why only a column passes what is ahead of this leader; None when more do."""
        if self._leading.rounding:
            return "way round a trap"
        ahead = partial(self._leading.lead.ahead, pose)
        gap_m = narrow_gap_m(self._obstacles.points(pose), ahead, self._mission.radius_m, self._mission.half_width_m)
        return None if gap_m is None else f"gap of {gap_m:.1f} m"


def _meant(wanted: Twist) -> Twist:
    """Return `wanted` without the ramp from rest: the same bend, at `MEANT_MPS` at least."""
    v = abs(wanted.linear_x)
    if not 0.0 < v < MEANT_MPS:
        return wanted
    return Twist(wanted.linear_x * MEANT_MPS / v, wanted.angular_z * MEANT_MPS / v)
