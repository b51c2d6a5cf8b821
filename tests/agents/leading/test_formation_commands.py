"""The leader's orientation requests: past known obstacles the chain falls into column hop by hop, and stays in it."""

from __future__ import annotations

from math import pi

import pytest

from lfa.agents.formation.formation import Formation, named, slots_of
from lfa.agents.leading.formation_commands import FOLD_S, FormationCommands
from lfa.agents.leading.path_follower import PathFollower
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Event, FormationNote, RouteProgress
from lfa.protocol.mission import FormationSpec, Leading, Limits, Mission, Orientation
from lfa.protocol.outbox import Outbox

FOLLOWERS = (2, 3, 4)
LEFT = 2.0 * pi / 3.0


def asked(known: tuple[tuple[float, float, float], ...], until_s: float) -> list[tuple[float, ...]]:
    """phi^d of the followers, of each request that a leader who stands half a metre along makes within that time."""
    orientations = (Orientation(0.4, "right"),)
    leading = Leading(route_m=((20.0, 0.0),), known_m=known, orientations=orientations)
    mission = Mission(robots=(1, *FOLLOWERS), leading=leading, formation=FormationSpec(1.2, pi / 3.0, "left"))
    outbox, lead = Outbox("fleet", "robot1", 1), PathFollower(leading, Limits())
    orders = FormationCommands(outbox, mission, Formation.of(mission))
    orders.begin(0.0)
    lead.begin(Pose2D())
    orders.lead(lead, FOLLOWERS, Term(2, 1, 1), 0.0, lambda: None)
    lead.track(Pose2D(0.5))
    for n in range(round(until_s * 50)):
        orders.lead(lead, FOLLOWERS, Term(2, 1, 1), n / 50, lambda: None)
    said = [envelope.message for envelope in outbox.drain()]
    new = [n for n, message in enumerate(said) if isinstance(message, Event) and message.kind == "formation"]
    return [tuple(slot.phi for slot in note.slots) for n in new if isinstance(note := said[n - 1], FormationNote)]


def test_past_known_obstacles_the_last_hop_falls_into_column_first() -> None:
    found = asked(((10.0, 0.0, 0.25),), 5.0 * FOLD_S)
    assert found == [pytest.approx(phis) for phis in ((LEFT, LEFT, pi), (LEFT, pi, pi), (pi, pi, pi))]


def test_without_known_obstacles_the_missions_own_request_is_made_in_one() -> None:
    assert asked((), 1.0) == [pytest.approx((-LEFT, -LEFT, -LEFT))]


class Commands:
    """The formation commands of robot 2, that has heard robot 1 lead, and what they say once it leads itself."""

    def __init__(self, *orientations: Orientation) -> None:
        self.leading = Leading(route_m=((0.0, 0.0), (20.0, 0.0)), orientations=orientations)
        mission = Mission(robots=(1, 2, 3), leading=self.leading, formation=FormationSpec(1.2, pi / 3.0, "left"))
        self.outbox, self.formation = Outbox("fleet", 2, 1), Formation.of(mission)
        self.commands = FormationCommands(self.outbox, mission, self.formation)

    def hear(self, side: str, number: int) -> None:
        spec = named(side, FormationSpec(1.2, pi / 3.0, "left"))
        note = FormationNote(Header("robot1", 1, number, 0.0), Term(2, 1, 1), number, slots_of(spec, (2, 3)), side=side)
        assert self.formation.request(note)
        self.commands.hear(note)

    def lead(self, x: float, team: RouteProgress) -> dict[int, float]:
        """phi^d of each follower after the first step of leading at (x, 0)."""
        lead = PathFollower(self.leading, Limits())
        lead.begin(Pose2D(x), team)
        self.commands.begin(10.0)
        self.commands.lead(lead, (3, 1), Term(3, 2, 1), 10.0, lambda: None)
        said = [envelope.message for envelope in self.outbox.drain()]
        notes = [message for message in said if isinstance(message, FormationNote)]
        return {slot.robot: slot.phi for slot in notes[-1].slots}


def test_an_order_by_hand_is_newer_than_the_routes_that_the_former_leader_had_passed() -> None:
    team = Commands(Orientation(5.0, "column"))
    team.hear("column", 1)
    team.hear("right", 2)
    assert team.lead(4.5, RouteProgress(1, 14.0))[3] == pytest.approx(-LEFT)


def test_a_former_leader_takes_its_place_in_the_formation_that_was_ordered() -> None:
    team = Commands()
    team.hear("right", 1)
    assert team.lead(4.5, RouteProgress(1, 14.0)) == {3: pytest.approx(-LEFT), 1: pytest.approx(-LEFT)}


def test_an_order_that_the_former_leader_did_not_live_to_carry_out_is_the_next_ones() -> None:
    team = Commands()
    team.commands.remember("column", 9.0)
    assert team.lead(4.5, RouteProgress(1, 14.0)) == {3: pytest.approx(pi), 1: pytest.approx(pi)}


def test_an_order_that_is_older_than_the_former_leaders_last_is_not_carried_out_again() -> None:
    team = Commands()
    team.commands.remember("column", 9.0)
    team.hear("right", 1)
    assert team.lead(4.5, RouteProgress(1, 14.0))[3] == pytest.approx(-LEFT)
