"""`lfa plot`: draw `figures/*.png` of a run folder. Matplotlib is imported only when a figure is drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec
import typer

from lfa.deploy.terminal_text import print_visible
from lfa.deploy.whole_output import whole_folder

FIGURES = "figures"


def command(
    folder: Annotated[Path, typer.Argument(help="A run folder.")],
    kind: Annotated[Literal["png", "svg", "pdf"], typer.Option("--format", help="Kind of the files.")] = "png",
    column: Annotated[bool, typer.Option("--column", help="At the width of a paper's column (86 mm).")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the paths of the figures as JSON.")] = False,
) -> int:
    """Draw the figures of a run folder again."""
    from lfa.deploy.recording.mcap_reader import look_into

    look_into(folder)
    drawn = [str(path) for path in draw(folder, kind, column=column)]
    print_visible(msgspec.json.encode({"figures": drawn}).decode() if as_json else "\n".join(drawn))
    return 0


def draw(folder: Path, kind: str = "png", *, column: bool = False) -> list[Path]:
    """Draw all figures of the run in `folder` as files of `kind`, and return their paths."""
    from lfa.deploy.analysis.run_data import Run
    from lfa.deploy.view.figures import catalogue

    run = Run(folder)
    names = [f"{name}.{kind}" for name, *_ in catalogue.FIGURES]
    with whole_folder(folder / FIGURES) as fresh:
        for name, (figure, *_) in zip(names, catalogue.FIGURES, strict=True):
            (fresh / name).write_bytes(catalogue.saved_as(catalogue.drawn(figure, run, column=column), kind))
    return [folder / FIGURES / name for name in names]
