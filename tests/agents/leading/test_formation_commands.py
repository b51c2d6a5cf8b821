"""The leader's orientation requests: past known obstacles the chain falls into column hop by hop, and stays in it."""

from __future__ import annotations

from math import pi

import pytest

from lfa.agents.formation.formation import Formation
from lfa.agents.leading.formation_commands import FOLD_S, FormationCommands
from lfa.agents.leading.path_follower import PathFollower
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.team import Event, FormationNote
from lfa.protocol.mission import FormationSpec, Leading, Limits, Mission, Orientation
from lfa.protocol.outbox import Outbox

FOLLOWERS = (2, 3, 4)
LEFT = 2.0 * pi / 3.0


def asked(known: tuple[tuple[float, float, float], ...], until_s: float) -> list[tuple[float, ...]]:
    """phi^d of the followers, of each request that a leader who stands half a metre along makes within that time."""
    orientations = (Orientation(0.4, "right"),)
    leading = Leading(route_m=((20.0, 0.0),), known_m=known, orientations=orientations)
    mission = Mission(robots=(1, *FOLLOWERS), leading=leading, formation=FormationSpec(1.2, pi / 3.0, "left"))
    outbox, lead = Outbox("fleet", 1, 1), PathFollower(leading, Limits())
    orders = FormationCommands(outbox, mission, Formation.of(mission))
    orders.begin(0.0)
    lead.begin(Pose2D())
    orders.lead(lead, FOLLOWERS, Term(2, 1, 1), 0.0)
    lead.track(Pose2D(0.5))
    for n in range(round(until_s * 50)):
        orders.lead(lead, FOLLOWERS, Term(2, 1, 1), n / 50)
    said = [envelope.message for envelope in outbox.drain()]
    new = [n for n, message in enumerate(said) if isinstance(message, Event) and message.kind == "formation"]
    return [tuple(slot.phi for slot in note.slots) for n in new if isinstance(note := said[n - 1], FormationNote)]


def test_past_known_obstacles_the_last_hop_falls_into_column_first() -> None:
    found = asked(((10.0, 0.0, 0.25),), 5.0 * FOLD_S)
    assert found == [pytest.approx(phis) for phis in ((LEFT, LEFT, pi), (LEFT, pi, pi), (pi, pi, pi))]


def test_without_known_obstacles_the_missions_own_request_is_made_in_one() -> None:
    assert asked((), 1.0) == [pytest.approx((-LEFT, -LEFT, -LEFT))]
