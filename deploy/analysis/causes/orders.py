"""Orders that an operator gave during a run, from the recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from lfa.deploy.analysis.causes.effects import ASIDE
from lfa.deploy.analysis.causes.fact import Fact
from lfa.deploy.recording import mcap_reader


def facts(folder: Path) -> Iterator[Fact]:
    """Yield each order on the operator's topic; what only simulates a fault is none."""
    for owner, _, t, note in mcap_reader.messages(folder, frozenset({"operator"})):
        if note.command not in ASIDE:
            header = note.header
            number = f"operator {header.seq} of {header.sender}"
            yield Fact(t, "order", owner, f"an operator ordered: {note.command}", other=note.command, evidence=number)
