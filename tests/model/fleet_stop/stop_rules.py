"""What a gateway and an agent know of the fleet stop after an order or each other's word (E28 to E30), as pure rules.

The model decides with these; `stop_refinement.py` shows that `StopLatch` and `StopMemory` decide the same. Words are
numbers in their order: 0 none, then of epoch e the resume 2e - 1 and the stop 2e.
"""

from __future__ import annotations


def stands(word: int) -> bool:
    """Return True for a stop."""
    return word > 0 and word % 2 == 0


def ordered(known: int, certain: bool, word: int, named: bool) -> tuple[int, bool]:
    """Return word and certainty of a gateway after an order; `named`: the order names its incarnation."""
    return (word, certain or named) if word >= known else (known, certain)


def told(known: int, certain: bool, word: int, sure: bool) -> tuple[int, bool]:
    """Return word and certainty of a gateway after its agent's command."""
    adopted = word if word > known and (stands(word) or not certain) else known
    return adopted, certain or sure


def enough(heard: int, robots: int) -> bool:
    """Return True if an agent that has heard the agents in the mask `heard`, itself included, is certain."""
    return 2 * heard.bit_count() > robots
