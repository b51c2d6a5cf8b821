"""`lfa list`: print the shipped scenarios with team size and title."""

from __future__ import annotations

from typing import Annotated

import msgspec
import typer

from lfa.world.description.load import titled


def command(as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False) -> int:
    rows = [
        {"name": name, "robots": len(s.mission.robots), "time_limit_s": s.time_limit_s, "title": s.title}
        for name, s in titled().items()
    ]
    if as_json:
        print(msgspec.json.encode(rows).decode())
        return 0
    for row in rows:
        print(f"{row['name']:<16}{row['robots']:>3} robots  {row['title']}")
    return 0
