"""`lfa plot`: draw `figures/*.png` of a run folder. Matplotlib is imported only when a figure is drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
import typer

FIGURES = "figures"


def command(
    folder: Annotated[Path, typer.Argument(help="A run folder.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the paths of the figures as JSON.")] = False,
) -> int:
    """Draw the figures of a run folder again."""
    from lfa.deploy.recording.mcap_reader import look_into

    look_into(folder)
    drawn = [str(path) for path in draw(folder)]
    print(msgspec.json.encode({"figures": drawn}).decode() if as_json else "\n".join(drawn))
    return 0


def draw(folder: Path) -> list[Path]:
    """Draw all figures of the run in `folder` and return their paths."""
    from lfa.deploy.analysis.run_data import Run
    from lfa.deploy.view.figures import catalogue

    run = Run(folder)
    (folder / FIGURES).mkdir(exist_ok=True)
    paths = []
    for name, *_ in catalogue.FIGURES:
        paths.append(folder / FIGURES / f"{name}.png")
        paths[-1].write_bytes(catalogue.png(catalogue.drawn(name, run)))
    return paths
