"""Orders that an operator gave during a run, from the recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lfa.deploy.analysis.causes.effects import ASIDE
from lfa.deploy.analysis.causes.fact import Fact
from lfa.deploy.recording import mcap_reader


def facts(folder: Path) -> Iterator[Fact]:
    """Yield each order of an operator, a repeated word to stop or to go once; what only simulates a fault is none."""
    words: set[tuple[int, bool]] = set()
    for owner, topic, t, note in mcap_reader.messages(folder, frozenset({"operator", "stop"})):
        if topic == "operator" and note.command not in ASIDE:
            yield _order(t, owner, topic, note.header, note.command)
        if topic == "stop" and note.word is not None and (note.word.epoch, note.word.stand) not in words:
            words.add((note.word.epoch, note.word.stand))
            yield _order(t, owner, topic, note.header, "stop" if note.word.stand else "resume")


def _order(t: float, owner: str, topic: str, header: Any, word: str) -> Fact:
    number = f"{topic} {header.seq} of {header.sender}"
    return Fact(t, "order", owner, f"an operator ordered: {word}", other=word, evidence=number)
