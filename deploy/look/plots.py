"""`lfa plot`, and `figures/*.png` of a run folder. Matplotlib is imported when a figure is drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

FIGURES = "figures"


def command(folder: Annotated[Path, typer.Argument(help="A run folder.")]) -> int:
    """Draw the figures of a run folder anew."""
    from deploy.look.trace import look_into

    look_into(folder)
    for path in draw(folder):
        print(path)
    return 0


def draw(folder: Path) -> list[Path]:
    """Draw all figures of the run in `folder`; their files."""
    from deploy.look import figures
    from deploy.look.readings import Run

    run = Run(folder)
    (folder / FIGURES).mkdir(exist_ok=True)
    paths = []
    for name, *_ in figures.FIGURES:
        paths.append(folder / FIGURES / f"{name}.png")
        paths[-1].write_bytes(figures.png(figures.drawn(name, run)))
    return paths
