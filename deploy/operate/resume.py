"""`lfa resume`: lifts a stop, so that the fleet goes on with what it was doing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lfa.deploy.operate import stop


def command(
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet, if several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Router, if not the fleet's own on this machine.")] = None,
    keys: Annotated[Path | None, typer.Option(help="Key folder from `lfa keys`, for a secured fleet.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
) -> int:
    """Lift the stop; return 0 if every robot may go, 1 if some have not answered. Raises Refused if none is stopped."""
    return stop.say(fleet, connect, keys, as_json, stand=False)
