"""Formatting of tables, texts and numbers for an HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

Cells = Sequence[object]
NONE = "–"


def table(heads: Cells, rows: Sequence[Cells], text: Sequence[int] = ()) -> str:
    """Return an HTML table. `text`: indices of the left-aligned text columns."""
    if not rows:
        return "<p>None.</p>"

    def line(cells: Cells, tag: str) -> str:
        marks = (' class="text"' if n in text else "" for n in range(len(cells)))
        return "".join(f"<{tag}{m}>{escape(str(c))}</{tag}>" for c, m in zip(cells, marks, strict=True))

    body = "".join(f"<tr>{line(row, 'td')}</tr>" for row in rows)
    return f'<div class="scroll"><table><thead><tr>{line(heads, "th")}</tr></thead><tbody>{body}</tbody></table></div>'


def short(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def in_mm(value_m: float | None) -> str:
    return NONE if value_m is None else f"{1000.0 * value_m:.1f} mm"


def in_deg(value_rad: float | None) -> str:
    return NONE if value_rad is None else f"{57.2958 * value_rad:.2f}°"


def in_s(value_s: float | None) -> str:
    return NONE if value_s is None else f"{value_s:.2f} s"


def in_ms(value_ms: float | None) -> str:
    return NONE if value_ms is None else f"{value_ms:.1f} ms"
