"""Loading of a scenario with overrides from the command line."""

from __future__ import annotations

from collections.abc import Sequence

from lfa.agents.following.factory import follower_of
from lfa.protocol.errors import Refused
from lfa.world.description.load import Scenario, load


def load_scenario(scenario: str, overrides: Sequence[str] = (), robots: int | None = None) -> Scenario:
    """Return `scenario` (name or path) with its values overridden.

    Also checks what otherwise only a robot checks: gains and controller. Raises Refused with one line.
    """
    chosen = load(scenario, overrides, robots)
    try:
        follower_of(chosen.mission)
    except Refused as refused:
        raise Refused(f"{scenario}: {refused}") from None
    return chosen
