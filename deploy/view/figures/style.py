"""Colours and line styles of the robots, the same in every figure, and the layout of labels that would overlap.

The colours are distinguishable with any colour vision. Up to seven robots differ in line style as well; more robots
get shades along the chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.robot_colours import PALETTE, as_hex, robot_colour

COLOURS = tuple(map(as_hex, PALETTE))
STYLES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)))
CLEAR: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.85}
"""Ground of a text that may stand on lines: they are not printed over it."""
LEGEND_MAX = 12
"""Maximum number of robots that a legend or an axis names."""


def look(run: Run, robot: int) -> dict[str, Any]:
    """Return colour and style of a robot's lines, the same in every figure."""
    n = run.robots.index(robot) if robot in run.robots else 0
    if len(run.robots) <= len(COLOURS):
        return {"color": COLOURS[n], "linestyle": STYLES[n]}
    return {"color": as_hex(robot_colour(n, len(run.robots))), "linestyle": "-"}


def label(run: Run, robot: int) -> str | None:
    """Return a name for the legend; with many robots None for all but the first, the last and some between."""
    n, many = run.robots.index(robot), len(run.robots)
    step = max(1, -(-many // LEGEND_MAX))
    return f"robot {robot}" if n % step == 0 or n == many - 1 else None


def levels(texts: Sequence[tuple[float, str]], letter: float, most: int) -> list[int]:
    """Return a line number for each label (position, text), so that no label covers another.

    `texts` is sorted by position. `letter`: width of a letter in units of the position. With more than `most` lines
    needed, the line that is free first is shared.
    """
    free_from = [float("-inf")] * most
    chosen = []
    for at, text in texts:
        level = next((n for n, free in enumerate(free_from) if free <= at), free_from.index(min(free_from)))
        free_from[level] = at + letter * (len(text) + 1)
        chosen.append(level)
    return chosen
