"""`lfa-world`: the simulated world of a scenario as one process, with the witness in it."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, Literal, NoReturn

import typer

from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.lease.witness import Witness
from lfa.protocol.node import Node
from lfa.protocol.runtime.node_runner import Options, run
from lfa.protocol.topics import WORLD_NAME, fleet_name
from lfa.protocol.transport.credentials import credentials
from lfa.protocol.transport.zenoh_config import LINK_LEASES_MS, default_endpoint
from lfa.world.description.load import draw, load

EXTRA = ("numpy", "pymunk", "PIL")
EXAMPLE = "Example: lfa-world paper_path1 --seed 7 --set world.lidar.beams=90"


def start(
    scenario: Annotated[str, typer.Argument(help="Name of a shipped scenario, or a file in TOML.")],
    seed: Annotated[int, typer.Option(help="Draws noise, obstacle places and start poses.")] = 0,
    set_: Annotated[
        list[str] | None, typer.Option("--set", help="Override a field, a.b=value; again for more.")
    ] = None,
    robots: Annotated[int | None, typer.Option(help="Size of the team, ids 1 to N.")] = None,
    fleet: Annotated[str, typer.Option(help="Name of the fleet: part of every key.")] = "fleet",
    connect: Annotated[str | None, typer.Option(help="Router, like tcp/127.0.0.1:7447; a,b: or the next.")] = None,
    keys: Annotated[Path | None, typer.Option(help="This machine's folder of `lfa keys`.")] = None,
    link: Annotated[
        Literal["fast", "std", "wifi"], typer.Option(help="How soon a silent link counts as dead: 0.5, 1 or 2 s.")
    ] = "std",
    journal: Annotated[Path | None, typer.Option(help="Folder for the journal of inputs.")] = None,
    witness: Annotated[bool, typer.Option(help="Hold the mission's witness here.")] = True,
    state: Annotated[Path | None, typer.Option(help="Run folder to keep the bodies' state in, for --resume.")] = None,
    resume: Annotated[Path | None, typer.Option(help="Run folder whose world goes on from its last state.")] = None,
    faults: Annotated[bool, typer.Option("--faults", help="Obey an operator's radio weather: for tests.")] = False,
) -> int:
    """Simulate the bodies, sensors and gateways of a team until stopped (Ctrl-C or SIGTERM)."""
    from lfa.world import checkpoint  # what these need is not in the base install
    from lfa.world.world import World

    drawn = draw(load(scenario, set_ or (), robots), seed)
    wall_ms = clock.wall_ms()
    known_as = None if keys is None else credentials(keys, WORLD_NAME, wall_ms)
    endpoint = connect or default_endpoint()
    notify = os.environ.get("NOTIFY_SOCKET", "")
    options = Options(fleet_name(fleet), endpoint, journal, faults, LINK_LEASES_MS[link], known_as, notify)
    known = None if resume is None else checkpoint.read(resume)
    placed = drawn if known is None else checkpoint.resumed(drawn, known)
    world = World(fleet, placed, seed, wall_ms, start_at=clock.now(), memory=known)
    nodes: list[Node] = [world if state is None else checkpoint.Remembering(world, state)]
    if witness and drawn.mission.witness:
        nodes.append(Witness(fleet, wall_ms, wall_ms))
    return run(nodes, options, wall_ms)


def main() -> None:
    """Entry point of `lfa-world`."""
    app = typer.Typer(
        context_settings={"help_option_names": ["-h", "--help"]},
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
    )
    app.command(epilog=EXAMPLE)(start)
    try:
        sys.exit(app(standalone_mode=False, prog_name="lfa-world"))
    except Refused as refused:
        _refuse(str(refused))
    except ModuleNotFoundError as error:
        if error.name not in EXTRA:
            raise
        _refuse(f"needs {error.name}: install with: pip install 'lfa[world]'")
    except typer.TyperException as error:  # what the parser refuses: an unknown option, a word for a number
        _refuse(error.format_message())


def _refuse(line: str) -> NoReturn:
    print(f"lfa-world: {line}", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
