"""Foreign text on the terminal: shown as text, never taken for markup, with control characters made visible.

Status texts, names and log lines come from other machines. Every command that prints a text of them uses this module.
"""

from __future__ import annotations

import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.text import Text

HIDDEN = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Unicode categories that a terminal obeys or hides: controls, formats (bidirectional overrides), line separators."""


def visible(text: str) -> str:
    r"""Return `text` with each control or format character written as an escape, such as `\x1b`; a tab stays."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        char if char == "\t" or unicodedata.category(char) not in HIDDEN else ascii(char)[1:-1] for char in text
    )


def cell(text: str, style: str = "") -> Text:
    """Return `text` for a rich table or line: visible, and without markup."""
    from rich.text import Text

    return Text(visible(text), style=style)
