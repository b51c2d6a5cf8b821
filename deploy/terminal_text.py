"""Foreign text on the terminal: shown as text, never taken for markup, with control characters made visible.

Status texts, names, reasons and paths come from other machines and from files. Every command prints by this module, or
by `write_line`, which does the same.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TextIO

from lfa.protocol.output import visible, visible_lines

if TYPE_CHECKING:
    from rich.text import Text


def print_visible(text: object, file: TextIO | None = None, end: str = "\n", *, flush: bool = False) -> None:
    """Print the lines of `text` with their control characters made visible; JSON stays JSON. Raises OSError."""
    print(visible_lines(str(text)), file=file, end=end, flush=flush)


def cell(text: str, style: str = "") -> Text:
    """Return `text` for a rich table or line: visible, and without markup."""
    from rich.text import Text

    return Text(visible(text), style=style)
