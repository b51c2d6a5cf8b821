"""`lfa-world`: the simulated world of a scenario as one process, which also hosts the witness."""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # noqa: F401 (before any other module)

# isort: split
import os
import sys
from pathlib import Path
from typing import Annotated, Literal, NoReturn

import typer

from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.mission_checks import check_mission
from lfa.protocol.node import Node
from lfa.protocol.output import write_line
from lfa.protocol.plug_in import is_file
from lfa.protocol.runtime.node_runner import Options, run
from lfa.protocol.topics import WORLD_NAME, fleet_name
from lfa.protocol.transport.credentials import credentials
from lfa.protocol.transport.zenoh_config import LINK_LEASES_MS, default_endpoint
from lfa.protocol.witness import Witness
from lfa.world.description.generator import GENERATORS
from lfa.world.description.load import draw, load
from lfa.world.description.own_sensor import INSTALLED_RULE, SENSORS

EXTRA = ("numpy", "pymunk", "PIL")
EXAMPLE = "Example: lfa-world paper_path1 --seed 7 --set world.lidar.beams=90"


def start(
    scenario: Annotated[str, typer.Argument(help="A shipped scenario, a TOML file, or a generator: FILE.py:Class.")],
    seed: Annotated[int, typer.Option(help="Seed of noise, obstacle positions and start poses.")] = 0,
    set_: Annotated[list[str] | None, typer.Option("--set", help="Override a field, a.b=value; repeatable.")] = None,
    robots: Annotated[int | None, typer.Option(help="Team size; the ids become 1 to N.")] = None,
    fleet: Annotated[str, typer.Option(help="Name of the fleet, part of every key.")] = "fleet",
    connect: Annotated[str | None, typer.Option(help="Router, as tcp/127.0.0.1:7450; a,b: tried in turn.")] = None,
    keys: Annotated[Path | None, typer.Option(help="This machine's key folder from `lfa keys`.")] = None,
    link: Annotated[
        Literal["fast", "std", "wifi", "auto"], typer.Option(help="Timeout of a silent link: 0.5, 1, 2 or 2 s.")
    ] = "std",
    journal: Annotated[Path | None, typer.Option(help="Folder for the journal of inputs.")] = None,
    witness: Annotated[bool, typer.Option(help="Host the mission's witness here.")] = True,
    state: Annotated[Path | None, typer.Option(help="Run folder for the checkpoint that --resume reads.")] = None,
    resume: Annotated[Path | None, typer.Option(help="Run folder whose last checkpoint to continue from.")] = None,
    leader_from: Annotated[
        str | None,
        typer.Option(
            help="The leader drives as the robot of a rosbag2 (FOLDER or FOLDER:TOPIC) or of an MRCLAM FILE.dat."
        ),
    ] = None,
    sensor: Annotated[
        list[str] | None, typer.Option(help="Load a sensor that the scenario names: FILE.py:Class; repeatable.")
    ] = None,
    faults: Annotated[bool, typer.Option("--faults", help="Obey `lfa fault cut` and `loss`; for tests.")] = False,
) -> int:
    """Simulate the bodies, sensors and gateways of a team until stopped (Ctrl-C or SIGTERM)."""
    from lfa.world import checkpoint  # these need packages that are not in the base install
    from lfa.world.description.recorded_leader import with_leader
    from lfa.world.world import World

    if is_file(scenario):
        GENERATORS.add_file(scenario)
    for own_code in sensor or ():
        SENSORS.add_file(own_code)
    loaded = load(scenario, set_ or (), robots, (INSTALLED_RULE,))
    if leader_from is not None:
        loaded = with_leader(loaded, leader_from)
        check_mission(loaded.mission)
    drawn = draw(loaded, seed)
    wall_ms = clock.wall_ms()
    known_as = None if keys is None else credentials(keys, WORLD_NAME, wall_ms)
    endpoint = connect or default_endpoint()
    notify = os.environ.get("NOTIFY_SOCKET", "")
    options = Options(fleet_name(fleet), endpoint, journal, faults, LINK_LEASES_MS[link], known_as, notify)
    known = None if resume is None else checkpoint.read(resume)
    placed = drawn if known is None else checkpoint.resumed(drawn, known)
    incarnation = incarnations.drawn()
    world = World(fleet, placed, seed, incarnation, start_at=clock.now(), memory=known)
    nodes: list[Node] = [world if state is None else checkpoint.Remembering(world, state)]
    if witness and drawn.mission.witness:
        nodes.append(Witness(fleet, incarnation, wall_ms))
    return run(nodes, options, wall_ms)


def main() -> None:
    """Run `lfa-world` (entry point)."""
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
        _refuse(*refused.lines)
    except ModuleNotFoundError as error:
        if error.name not in EXTRA:
            raise
        _refuse(f"needs {error.name}: install with: pip install 'lfa[world]'")
    except typer.TyperException as error:  # parser errors: an unknown option, text for a number
        _refuse(error.format_message())


def _refuse(*lines: str) -> NoReturn:
    for line in lines:
        write_line(f"lfa-world: {line}", sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
