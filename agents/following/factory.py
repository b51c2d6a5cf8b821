"""Construction of a follower from a mission: gains, controller, observer and buffer."""

from __future__ import annotations

import msgspec

from lfa.agents.config import Gains, check_gains
from lfa.agents.following.follower import Follower
from lfa.agents.following.plugin import make_controller
from lfa.agents.following.predecessor import DEAD_RECKONING_FOLLOWERS_MAX, Predecessor
from lfa.protocol.errors import Refused
from lfa.protocol.mission import Mission


def gains_of(mission: Mission) -> Gains:
    """Return the mission's gains. Raise `Refused` for an unknown name or a broken rule."""
    following = mission.following
    try:
        gains = msgspec.convert(following.gains, Gains)
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
        heading_filter_m=mission.formation.heading_filter_m,
        cruise_mps=mission.leading.cruise_mps,
        radius_m=mission.radius_m,
        paper_observer=following.observer == "paper",
    )


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
