"""The table of the lease's states and transitions, as text, and into protocol/README.md when run as a program."""

from __future__ import annotations

import re
from pathlib import Path

from lfa.protocol.lease.machine.table import ALL, LEADS, LEADS_NOT, MEANING, TRANSITIONS, LeaseState

PAGE = Path(__file__).parents[3] / "protocol" / "README.md"
BEGIN, END = "<!-- begin: python -m tests.protocol.lease.page -->\n", "<!-- end -->"
GROUPS = {ALL: "any", LEADS: "leader, raising, switching", LEADS_NOT: "any that does not lead"}


def text() -> str:
    """Return both tables as Markdown."""
    lines = ["| state | holds |", "| --- | --- |"]
    lines += [f"| {state} | {meaning} |" for state, meaning in MEANING.items()]
    lines += ["", "An event that is not in the next table does nothing. A process may also stay in its state.", ""]
    lines += ["| event | in state | does | may get to | rules |", "| --- | --- | --- | --- | --- |"]
    for row in TRANSITIONS:
        lines.append(f"| {row.event} | {_names(row.states)} | {row.text} | {_names(row.to)} | {row.rules} |")
    return "\n".join(lines) + "\n"


def _names(states: tuple[LeaseState, ...]) -> str:
    return GROUPS.get(states) or ", ".join(states) or "-"


def on_page() -> str:
    """Return what stands between the marks on the page."""
    return PAGE.read_text(encoding="utf-8").split(BEGIN)[1].split(END)[0]


if __name__ == "__main__":
    whole = PAGE.read_text(encoding="utf-8")
    whole = re.sub(f"{BEGIN}.*?{END}", lambda _: BEGIN + text() + END, whole, flags=re.DOTALL)
    PAGE.write_text(whole, encoding="utf-8")
