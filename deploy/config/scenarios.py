"""`lfa list`: print the shipped scenarios with team size and title, and the plug-ins that are installed."""

from __future__ import annotations

from typing import Annotated

import msgspec
import typer

from lfa.agents.behaviors.own_behavior import BEHAVIORS
from lfa.agents.following.controller import CONTROLLERS
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused
from lfa.world.description.generator import GENERATORS, title_of
from lfa.world.description.load import titled
from lfa.world.description.own_sensor import SENSORS


def command(as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False) -> int:
    rows = [
        {
            "name": name, "kind": "scenario", "robots": len(s.mission.robots), "time_limit_s": s.time_limit_s,
            "title": s.title,
        }
        for name, s in titled().items()
    ]  # fmt: skip
    plug_ins = [{"name": name, "kind": "scenario generator", "title": _title(name)} for name in GENERATORS.names()]
    plug_ins += [{"name": name, "kind": "controller"} for name in CONTROLLERS.installed()]
    plug_ins += [{"name": name, "kind": "sensor"} for name in SENSORS.names()]
    plug_ins += [{"name": name, "kind": "behavior"} for name in BEHAVIORS.names()]
    if as_json:
        print_visible(msgspec.json.encode([*rows, *plug_ins]).decode())
        return 0
    for row in rows:
        print_visible(f"{row['name']:<16}{row['robots']:>3} robots  {row['title']}")
    print_visible("")
    for one in plug_ins:
        print_visible(f"{one['name']:<16}{one['kind']}{': ' if 'title' in one else ''}{one.get('title', '')}")
    return 0


def _title(name: str) -> str:
    """Return the title of a scenario generator, or why it cannot be loaded."""
    try:
        return title_of(name)
    except Refused as refused:
        return str(refused)
