"""One colour for each robot, the same in figures, reports, films and views. Distinguishable with any colour vision."""

from __future__ import annotations

Colour = tuple[int, int, int]

PALETTE: tuple[Colour, ...] = (
    (0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233), (110, 110, 110),
)  # fmt: skip
"""Colours of up to seven robots: those of Okabe and Ito, with grey for black, which a dark page would hide."""
DARK, LIGHT = (40, 60, 140), (250, 220, 60)
"""Ends of the shades of a larger team, in the order of its chain."""


def robot_colour(n: int, of: int) -> Colour:
    """Return the colour (red, green, blue, 0 to 255) of the `n`-th robot, from 0, in a team of `of`."""
    if of <= len(PALETTE):
        return PALETTE[n]
    part = n / (of - 1)
    red, green, blue = (round(a + part * (b - a)) for a, b in zip(DARK, LIGHT, strict=True))
    return red, green, blue


def as_hex(colour: Colour) -> str:
    """Return a colour as `#rrggbb`."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
