"""Hook of the documentation site: a table of numbered rules or of words becomes a section for each of its rows.

The site's search knows sections only. Of a table of 36 rules it shows the page at best, with an answer to "E15"
somewhere on it; as a section, each rule is found under its own number, and has an address.
"""

from __future__ import annotations

import re
from typing import Any

TABLE = re.compile(r"^(\|[^\n]*\|)\n\| --- [^\n]*\n((?:\|[^\n]*\|\n)+)", re.MULTILINE)
NUMBERED = re.compile(r"\| [EILS]\d+ \|")
WORDS = "| word |"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Return the page's text with its tables of rules and words as sections; mkdocs calls it for each page."""
    return TABLE.sub(_sections, markdown)


def _sections(table: re.Match[str]) -> str:
    """Return the rows of one table as sections, or the table as it is."""
    head, rows = table[1], table[2].splitlines()
    if not (head.startswith(WORDS) or all(map(NUMBERED.match, rows))):
        return table[0]
    first, *columns = _cells(head)
    lead = "" if first else f"\n{columns[0].capitalize()}:\n"
    return lead + "".join(_section(columns, *_cells(row)) for row in rows) + "\n---\n"


def _section(columns: list[str], name: str, text: str, *further: str) -> str:
    """Return a heading with the text of a row; further cells stand below it under the names of their columns."""
    below = [f"{column}: {cell}" for column, cell in zip(columns[1:], further, strict=True) if cell not in ("", "-")]
    return "\n".join(["", f"#### {name}", "", text, *(f"\n*{line}*" for line in below), ""])


def _cells(row: str) -> list[str]:
    return [cell.strip() for cell in row.strip("|").split(" | ")]
