"""The scenario that a person asked for, checked as far as it can be before anything starts."""

from __future__ import annotations

from collections.abc import Sequence

from agents.following import follower_of
from protocol.mission import Refused
from world.scenario import Scenario, load


def choose(scenario: str, overrides: Sequence[str] = (), robots: int | None = None) -> Scenario:
    """`scenario` by name or path, its values overridden; also what only a robot could refuse (gains, controller).

    Raises Refused with one line.
    """
    chosen = load(scenario, overrides, robots)
    try:
        follower_of(chosen.mission)
    except Refused as refused:
        raise Refused(f"{scenario}: {refused}") from None
    return chosen
