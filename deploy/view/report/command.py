"""`lfa report`: write one run, or two side by side, as one HTML page that asks for nothing else."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused
from lfa.protocol.output import replace_file, write_line

REPORT = "report.html"


def command(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")],
    other: Annotated[Path | None, typer.Argument(metavar="[RUN2]", help="Second run, shown side by side.")] = None,
    out: Annotated[Path | None, typer.Option(help="File; default report.html in the (first) run folder.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the path of the page as JSON.")] = False,
) -> int:
    folders = [folder] if other is None else [folder, other]
    path = out or folder / (REPORT if other is None else f"report-vs-{other.resolve().name}.html")
    check_finished(folders)
    if not path.resolve().parent.is_dir():
        raise Refused(f"--out {path}: must be in a folder that exists")
    write_line("reading the recording and drawing the figures ...", sys.stderr)
    page = html(folders)
    reason = _written(path, page.encode())
    if reason:
        raise Refused(f"--out {path}: cannot be written ({reason})")
    print_visible(msgspec.json.encode({"report": str(path)}).decode() if as_json else path)
    return 0


def _written(path: Path, page: bytes) -> str:
    """Write the page, in one step where a file is or will be; return the reason of a failure, else ""."""
    if path.is_file() or not path.exists():
        return replace_file(path, page)
    try:
        path.write_bytes(page)  # a device or a pipe
    except OSError as error:  # a folder, too
        return error.strerror or str(error)
    return ""


def html(folders: list[Path]) -> str:
    """Return the page about one or two runs. Raises Refused for a folder that is no finished run."""
    from lfa.deploy.analysis.run_data import Run
    from lfa.deploy.recording.mcap_reader import look_into
    from lfa.deploy.view.report import page

    check_finished(folders)
    for folder in folders:
        look_into(folder)
    return page.of([Run(folder) for folder in folders])


def check_finished(folders: list[Path]) -> None:
    """Raise Refused, with what is missing, for a folder that is no finished run."""
    for folder in folders:
        for needed in ("summary.json", "recording.mcap", "scenario.toml"):
            if not (folder / needed).is_file():
                raise Refused(f"{folder}: no finished run, it has no {needed}")
