"""How robots look in figures: colours and line styles, the same in every one; and where labels go that would overlap.

Colours can be told apart with any colour vision; up to seven robots differ in line style as well, more are shades
along the chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib import colormaps

from lfa.deploy.analysis.run_data import Run

# Okabe and Ito's palette.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
STYLES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)))
LEGEND_MAX = 12


def look(run: Run, robot: int) -> dict[str, Any]:
    """Colour and style of a robot's lines, the same in every figure."""
    n = run.robots.index(robot) if robot in run.robots else 0
    if len(run.robots) <= len(COLOURS):
        return {"color": COLOURS[n], "linestyle": STYLES[n]}
    return {"color": colormaps["viridis"](0.95 * n / (len(run.robots) - 1)), "linestyle": "-"}


def label(run: Run, robot: int) -> str | None:
    """A name for the legend; with many robots only the first, the last and some between have one."""
    n, many = run.robots.index(robot), len(run.robots)
    step = max(1, -(-many // LEGEND_MAX))
    return f"robot {robot}" if n % step == 0 or n == many - 1 else None


def levels(texts: Sequence[tuple[float, str]], letter: float, most: int) -> list[int]:
    """Of labels that begin at these places, in their order, lines to write them in so that none covers another.

    `letter` is a letter's width in units of the places. With more than `most` lines the one that is free first is
    shared.
    """
    free_from = [float("-inf")] * most
    chosen = []
    for at, text in texts:
        level = next((n for n, free in enumerate(free_from) if free <= at), free_from.index(min(free_from)))
        free_from[level] = at + letter * (len(text) + 1)
        chosen.append(level)
    return chosen
