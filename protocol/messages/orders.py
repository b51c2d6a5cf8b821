"""Messages by which an operator changes what a team does while it runs (E32)."""

from __future__ import annotations

from msgspec import Struct

from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.header import Count, Header
from lfa.protocol.mission import FormationSpec, Leading


class TeamOrder(Struct, frozen=True, array_like=True):
    """Part of the mission that may change while a team runs; of two, the higher version holds."""

    leading: Leading
    formation: FormationSpec
    version: Count = 0
    """0: the mission as it began."""
    route: Count = 0
    """Version with which the route changed last: progress is counted along this route."""
    paused: bool = False
    """True: the leader stands, and its team with it."""


class OrderNote(Struct, frozen=True, array_like=True, tag="team_order"):
    """Order as an operator proposes it (`term` None), or as the leader of `term` carries it."""

    header: Header
    order: TeamOrder
    term: Term | None = None
