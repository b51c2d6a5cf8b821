"""Behaviour of a leader: its motion, a detour, or a planned way."""

from __future__ import annotations

from functools import partial
from math import inf

from lfa.agents.avoidance.decision import Action, Decision
from lfa.agents.avoidance.detour import Detour
from lfa.agents.leading.leader import Leadership
from lfa.agents.leading.narrow_gap import narrow_gap_m
from lfa.agents.perception.obstacle_model import ObstacleModel
from lfa.agents.perception.scan import Point
from lfa.protocol.geometry import Pose2D, Twist

ROUND_TRAP = Decision(Action.PLAN_ROUND, inf, 0.0, "wall", "no local way leads on", "angle")
"""Decision of a leader whose detour leads nowhere, for the log."""


class LeadRoute:
    """Leading behaviour of one robot; `leading` chooses the motion, `detour` holds the present decision."""

    def __init__(self, leading: Leadership, detour: Detour, obstacles: ObstacleModel, radius_m: float) -> None:
        self._leading = leading
        self._detour = detour
        self._obstacles = obstacles
        self._radius_m = radius_m

    def step(self, chain: tuple[int, ...], points: list[Point], pose: Pose2D, last: Twist, now: float) -> Twist:
        """Return the wanted twist of the leader of `chain`; `points` are what stands, in `base_link`."""
        around_these = self._leading.look(points, pose, now)
        wanted, speed = self._leading.step(chain, pose, last, now)
        planned = self._leading.planned(points, pose, wanted, last, self._detour.decision, now)
        if planned is not None:
            if self._leading.rounding:
                self._detour.decision = ROUND_TRAP
            return planned
        target = self._leading.target(pose)
        around = self._detour.steer(
            around_these, target, wanted, speed, now, lambda free_m: self._obstacles.blocking(pose, wanted, free_m, now)
        )
        return wanted if around is None else around

    def narrow_ahead(self, pose: Pose2D) -> str | None:
        """Return the reason why only a column passes what is ahead of this leader; None when more do."""
        if self._leading.rounding:
            return "way round a trap"
        ahead = partial(self._leading.lead.ahead, pose)
        gap_m = narrow_gap_m(self._obstacles.points(pose), ahead, self._radius_m)
        return None if gap_m is None else f"gap of {gap_m:.1f} m"
