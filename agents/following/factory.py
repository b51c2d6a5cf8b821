"""Construction of a follower from a mission: gains, controller, observer and buffer."""

from __future__ import annotations

from math import cos

import msgspec

from lfa.agents.config import DEFAULT, Gains, check_gains
from lfa.agents.following.follower import Follower
from lfa.agents.following.plugin import make_controller
from lfa.agents.following.predecessor import DEAD_RECKONING_FOLLOWERS_MAX, Predecessor
from lfa.agents.formation.formation import phi_of
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Mission

FILTER_SHARE = 0.6
"""L_chi as a share of k |cos phi|: above the 0.5 from which no wave across the path grows (5.3)."""
GUARDED_M, SLOT_ROOM_M = 0.15, 0.1
"""Room [m] between two bodies that the collision guard keeps, and the distance [m] by which a follower may be nearer
than its slot at least, where k^d leaves less room."""


def gains_of(mission: Mission) -> Gains:
    """Return the mission's gains. Raise `Refused` for an unknown name or a broken rule.

    The collision guard keeps `GUARDED_M` between two bodies, but lets a follower come `SLOT_ROOM_M` nearer than k^d.
    """
    following, wide_m = mission.following, 2.0 * mission.radius_m + GUARDED_M
    d_min_m = max(DEFAULT.d_min_m, min(wide_m, mission.formation.separation_m - SLOT_ROOM_M))
    try:
        gains = msgspec.convert({"d_min_m": d_min_m, **following.gains}, Gains)
    except msgspec.ValidationError as error:
        names = ", ".join(Gains.__struct_fields__)
        raise Refused(f"mission.following.gains: {error}; the names are {names}") from None
    return check_gains(gains, mission.limits, mission.control_period_s, allow_saturation=following.allow_saturation)


def follower_of(mission: Mission) -> Follower:
    """Return the mission's follower. Raise `Refused` when its gains or its controller are invalid."""
    gains, following = gains_of(mission), mission.following
    return Follower(
        gains,
        mission.limits,
        make_controller(following, gains, mission.limits),
        name=following.controller,
        heading_filter_m=heading_filter_of(mission),
        cruise_mps=mission.leading.cruise_mps,
        radius_m=mission.radius_m,
        paper_observer=following.observer == "paper",
    )


def heading_filter_of(mission: Mission) -> float:
    """Return L_chi [m]: the mission's, or the one with which nothing grows along a chain of its length (5.4)."""
    spec = mission.formation
    rigid = mission.following.trace or len(mission.robots) - 1 <= DEAD_RECKONING_FOLLOWERS_MAX
    if spec.heading_filter_m > 0.0 or rigid:
        return spec.heading_filter_m
    return FILTER_SHARE * spec.separation_m * abs(cos(phi_of(spec.side, spec.angle_rad, 0)))


def predecessor_of(mission: Mission, robot: int, followers: int, previous: Predecessor | None = None) -> Predecessor:
    """Return `robot` as predecessor in a chain of `followers`; `previous` is the predecessor that it replaces."""
    following = mission.following
    delay_s = following.delay_s
    if delay_s is None and followers <= DEAD_RECKONING_FOLLOWERS_MAX:
        delay_s = 0.0
    # The paper's observer does not predict over latency: it uses each pose as received.
    paper = following.observer == "paper"
    return Predecessor(
        robot,
        mode="pose" if following.observer == "pose" else "velocity",
        extrapolation_max_s=0.0 if paper else gains_of(mission).dead_reckoning_max_s,
        delay_s=0.0 if paper else delay_s,
        period_s=mission.control_period_s,
        trace_m=mission.formation.separation_m,
        trace=previous.trace if previous is not None else None,
    )
