"""`lfa-agent`: one robot, or the witness, as one process."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from agents.agent import Agent
from protocol import clock
from protocol.mission import Mission, Refused, check_mission
from protocol.runtime import Options, run
from protocol.witness import Witness
from protocol.zenoh_bus import default_endpoint

ROLES = ("leader", "follower", "witness")
EXAMPLE = "Example: lfa-agent --role follower --id 2"


def start(
    role: Annotated[str, typer.Option(help="Place it starts in: leader, follower or witness. Roles change later.")],
    id: Annotated[str, typer.Option(help="Robot id from the mission (1, 2, ...), or w for the witness.")],
    fleet: Annotated[str, typer.Option(help="Name of the fleet: part of every key.")] = "fleet",
    connect: Annotated[str | None, typer.Option(help="Router's endpoint, like tcp/127.0.0.1:7447.")] = None,
    mission: Annotated[Path | None, typer.Option(help="Mission as JSON or TOML; else it comes over Zenoh.")] = None,
    journal: Annotated[Path | None, typer.Option(help="Folder for the journal of inputs.")] = None,
) -> None:
    """Run one robot of a fleet until it is stopped (Ctrl-C or SIGTERM)."""
    try:
        given = None if mission is None else read_mission(mission)
        options = Options(_fleet(fleet), connect or default_endpoint(), journal)
        wall_ms = clock.wall_ms()
        node = _node(role, id, fleet, wall_ms, given)
        code = run([node], options, wall_ms)
    except Refused as refused:
        print(f"lfa-agent: {refused}", file=sys.stderr)
        raise typer.Exit(2) from None
    raise typer.Exit(code)


def _node(role: str, id: str, fleet: str, wall_ms: int, mission: Mission | None) -> Agent | Witness:
    if role not in ROLES:
        raise Refused(f"--role {role}: must be one of {', '.join(ROLES)}")
    if role == "witness":
        if id not in ("w", "0"):
            raise Refused(f"--id {id}: the witness is w")
        return Witness(fleet, wall_ms, wall_ms, mission)
    if not id.isdecimal() or int(id) < 1 or int(id) > 2**31:
        raise Refused(f"--id {id}: must be a robot's number, 1 or higher")
    if mission is not None and int(id) not in mission.robots:
        raise Refused(f"--id {id}: not in the mission, which has robots {list(mission.robots)}")
    return Agent(int(id), wall_ms, fleet, wall_ms, mission)


def _fleet(name: str) -> str:
    if not name or not all(c.isalnum() or c in "-_." for c in name):
        raise Refused(f"--fleet {name!r}: must be letters, digits, '-', '_' or '.'")
    return name


def read_mission(path: Path) -> Mission:
    """A mission from a JSON or TOML file. Raises `Refused` with file, key and what would be right."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}") from None
    decode = msgspec.json.decode if path.suffix == ".json" else msgspec.toml.decode
    try:
        return check_mission(decode(data, type=Mission))
    except Refused as refused:
        raise Refused(f"{path}: {refused}") from None
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise Refused(f"{path}: {error}") from None


def main() -> None:
    """Entry point of `lfa-agent`."""
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command(epilog=EXAMPLE)(start)
    app()


if __name__ == "__main__":
    main()
