"""The table of lease messages in protocol/LEASE.md is that of the code."""

from __future__ import annotations

from typing import get_args

from lfa.protocol.messages.consensus import LeaseBody
from tests.test_imports import ROOT


def test_the_page_of_the_lease_has_each_message_once_with_its_fields() -> None:
    page = (ROOT / "protocol" / "LEASE.md").read_text()
    rows = page.split("### 3.3 Messages")[1].split("| --- | --- | --- |\n")[1].split("\n\n")[0].splitlines()
    cells = [[cell.strip() for cell in row.split("|")[1:3]] for row in rows]
    told = sorted((name, fields) for names, fields in cells for name in names.split(", "))
    assert told == sorted((kind.__name__.upper(), ", ".join(kind.__struct_fields__)) for kind in get_args(LeaseBody))
