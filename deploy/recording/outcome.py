"""Outcome of a run."""

from __future__ import annotations

from msgspec import Struct

from lfa.world.description.load import Outcome


class Verdict(Struct, frozen=True):
    """Outcome of a run, with the reason if it has one."""

    outcome: Outcome
    reason: str | None = None
