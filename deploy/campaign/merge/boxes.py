"""Distributions as a drawing: for each group one box from the first to the third quartile, with stems to the ends."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import floor, log10

import numpy as np

from lfa.deploy.campaign.sweep.statistics import Values, quartiles

WIDTH, LABEL, RIGHT = 900, 300, 30
ROW, TOP, BOTTOM = 24, 8, 26
TICKS = 5
LABEL_CHARACTERS = 42


def box_plot(groups: Sequence[tuple[str, Values]], unit: str) -> str:
    """Return an SVG figure of the groups (label, values); groups without values are named without a box."""
    known = [values for _, values in groups if values.size]
    low, high = (float(min(v.min() for v in known)), float(max(v.max() for v in known))) if known else (0.0, 1.0)
    ticks = _ticks(low, high)
    low, high = min(low, ticks[0]), max(high, ticks[-1])

    def x(value: float) -> float:
        return LABEL + (WIDTH - LABEL - RIGHT) * (value - low) / (high - low)

    height = TOP + ROW * len(groups) + BOTTOM
    parts = [
        f'<line class="axis" x1="{x(tick):.1f}" x2="{x(tick):.1f}" y1="{TOP}" y2="{height - BOTTOM}"/>'
        f'<text x="{x(tick):.1f}" y="{height - 8}" text-anchor="middle" class="soft">{tick:g}</text>'
        for tick in ticks
    ]
    for n, (label, values) in enumerate(groups):
        middle = TOP + ROW * n + ROW / 2
        shown = label if len(label) <= LABEL_CHARACTERS else f"{label[: LABEL_CHARACTERS - 1]}…"
        parts.append(f'<text x="0" y="{middle + 4:.1f}">{escape(shown)}</text>')
        parts.append(_box([x(v) for v in quartiles(values)], middle, label, values) if values.size else "")
    name = escape(f"distributions in {unit}" if unit else "distributions")
    return (
        f'<figure><div class="scroll"><svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{name}" '
        f'style="min-width:640px">{"".join(parts)}</svg></div></figure>'
    )


def _box(at: Sequence[float], y: float, label: str, values: Values) -> str:
    low, first, middle, third, high = at
    title = ", ".join(f"{value:.4g}" for value in quartiles(values))
    return (
        f"<g><title>{escape(label)}: {values.size} runs; least, quartiles, largest: {title}</title>"
        f'<line class="stem" x1="{low:.1f}" x2="{high:.1f}" y1="{y:.1f}" y2="{y:.1f}"/>'
        f'<rect class="box" x="{first:.1f}" y="{y - 7:.1f}" width="{max(third - first, 1.0):.1f}" height="14"/>'
        f'<line class="middle" x1="{middle:.1f}" x2="{middle:.1f}" y1="{y - 9:.1f}" y2="{y + 9:.1f}"/></g>'
    )


def _ticks(low: float, high: float) -> list[float]:
    """Return about `TICKS` round numbers around [low, high], at least two."""
    spread = high - low or abs(high) or 1.0
    rough = spread / TICKS
    power = 10.0 ** floor(log10(rough))
    step = next(power * m for m in (1.0, 2.0, 5.0, 10.0) if power * m >= rough)
    first, last = floor(low / step), floor(high / step) + 1
    return [float(f"{step * n:.12g}") for n in np.arange(first, last + 1)]
