"""The outcome of a run."""

from __future__ import annotations

from msgspec import Struct

from lfa.world.description.load import Outcome


class Verdict(Struct, frozen=True):
    outcome: Outcome
    reason: str | None = None
