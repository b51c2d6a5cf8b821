"""Page of a merged campaign: one HTML file without network or scripts, for light and dark, wide and narrow screens."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

CSS = Path(__file__).with_name("page.css")


class Section(NamedTuple):
    """Part of a page: its heading and its HTML."""

    title: str
    html: str


class Linked(NamedTuple):
    """Cell of a table that is a link."""

    text: str
    to: str


def page(title: str, about: str, warning: str, sections: Sequence[Section]) -> str:
    """Return the whole page; `warning` stands in its head unless it is empty."""
    links = " ".join(f'<a href="#{_id(one.title)}">{escape(one.title)}</a>' for one in sections)
    parts = "".join(f'<h2 id="{_id(one.title)}">{escape(one.title)}</h2>{one.html}' for one in sections)
    warned = f'<p class="warning">{escape(warning)}</p>' if warning else ""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>lfa: {escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width"><link rel="icon" href="data:,">'
        f"<style>{CSS.read_text(encoding='utf-8')}</style></head><body><nav>{links}</nav>"
        f'<h1>{escape(title)}</h1><p class="soft">{escape(about)}</p>{warned}{parts}</body></html>\n'
    )


def rows(heads: Sequence[str], body: Sequence[Sequence[object]], text: Sequence[int] = (), long: int = -1) -> str:
    """Return an HTML table. `text`: indices of left-aligned columns; `long`: index of the one that may break lines."""
    if not body:
        return "<p>None.</p>"

    def line(cells: Sequence[object], tag: str) -> str:
        return "".join(f"<{tag}{_marks(n, text, long)}>{_cell(cell)}</{tag}>" for n, cell in enumerate(cells))

    lines = "".join(f"<tr>{line(row, 'td')}</tr>" for row in body)
    return f'<div class="scroll"><table><thead><tr>{line(heads, "th")}</tr></thead><tbody>{lines}</tbody></table></div>'


def tiles(facts: Sequence[tuple[str, object]]) -> str:
    """Return a row of large values, each above its name."""
    shown = "".join(f'<div class="tile"><b>{escape(str(value))}</b>{escape(name)}</div>' for name, value in facts)
    return f'<div class="tiles">{shown}</div>'


def _cell(cell: object) -> str:
    if isinstance(cell, Linked):
        return f'<a href="{escape(cell.to)}">{escape(cell.text)}</a>'
    return escape(str(cell))


def _marks(n: int, text: Sequence[int], long: int) -> str:
    marks = [mark for mark, given in (("text", n in text or n == long), ("long", n == long)) if given]
    return f' class="{" ".join(marks)}"' if marks else ""


def _id(title: str) -> str:
    return title.lower().replace(" ", "-")
