"""Live progress of a run: a table that is redrawn on a terminal, otherwise a line every 5 s."""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol

from lfa.deploy.run.progress_rows import ProgressRows
from lfa.deploy.terminal_text import cell
from lfa.protocol.output import visible, write_line

if TYPE_CHECKING:
    from rich.live import Live
    from rich.table import Table

LINE_EVERY_S = 5.0
REDRAW_HZ = 5.0


class Progress(Protocol):
    """Display of a run's progress on stderr; stdout is reserved for the result."""

    def show(self, rows: ProgressRows, leader: int | None) -> None: ...

    def note(self, rows: ProgressRows, text: str) -> None:
        """Print a line about an occurrence, with the world's time [s]."""

    def close(self) -> None: ...


def progress() -> Progress:
    """Return the display that fits stderr: a table on a terminal, otherwise lines."""
    return _OnTerminal() if sys.stderr is not None and sys.stderr.isatty() else _InLines()


class _InLines:
    def __init__(self) -> None:
        self._next_s = 0.0
        self._leader: int | None = None

    def show(self, rows: ProgressRows, leader: int | None) -> None:
        if rows.time_s >= self._next_s or leader != self._leader:
            self._next_s = rows.time_s + LINE_EVERY_S
            self._leader = leader
            write_line(visible(rows.line(leader)), sys.stderr)

    def note(self, rows: ProgressRows, text: str) -> None:
        write_line(visible(f"{rows.time_s:7.1f} s  {text}"), sys.stderr)

    def close(self) -> None:
        pass


class _OnTerminal:
    """Table on a terminal; one that is closed ends the display and not the run."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.live import Live

        self._live: Live = Live(console=Console(stderr=True), refresh_per_second=REDRAW_HZ)
        self._live.start()

    def show(self, rows: ProgressRows, leader: int | None) -> None:
        with suppress(OSError):
            self._live.update(_table(rows, leader))

    def note(self, rows: ProgressRows, text: str) -> None:
        with suppress(OSError):
            self._live.console.print(cell(f"{rows.time_s:7.1f} s  {text}"))

    def close(self) -> None:
        with suppress(OSError):
            self._live.stop()


def _table(rows: ProgressRows, leader: int | None) -> Table:
    from rich.table import Table

    table = Table(title=cell(rows.headline(leader)), title_justify="left", box=None, padding=(0, 2))
    for heading in ("", "role", "distance error", "state"):
        table.add_column(heading, justify="right" if heading == "distance error" else "left")
    for row in rows.rows():
        table.add_row(*map(cell, row))
    return table
