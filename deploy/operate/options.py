"""Options shared by the commands to a running fleet: type and help text of each."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

FleetName = Annotated[str | None, typer.Option(help="Name of the fleet, if several run here.")]
Connect = Annotated[str | None, typer.Option(help="Router, if not the fleet's own on this machine.")]
Keys = Annotated[Path | None, typer.Option(help="Key folder from `lfa keys`, for a secured fleet.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")]
