"""`lfa replay`: re-execute the cores of a run on their journals and compare; or play its recording back onto a bus."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from lfa.deploy.own_code import RunBehavior, RunController, RunSensor, given_files
from lfa.deploy.scenario_loading import load_code_of_run
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused
from lfa.protocol.names import robot_name, whole_number

if TYPE_CHECKING:
    from lfa.deploy.analysis.verification.reexecution import Comparison

PLAYBACK_FLEET = "replay"


def command(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")],
    robot: Annotated[str | None, typer.Option(help="Compare: id of a robot, or world, witness, all.")] = None,
    speed: Annotated[float, typer.Option(help="Play back: speed relative to the recording.")] = 1.0,
    fleet: Annotated[str, typer.Option(help="Play back: name of the fleet to publish as.")] = PLAYBACK_FLEET,
    connect: Annotated[str | None, typer.Option(help="Play back: endpoint of the router.")] = None,
    controller: RunController = None,
    behavior: RunBehavior = None,
    sensor: RunSensor = None,
    as_json: Annotated[bool, typer.Option("--json", help="Compare: print the result as JSON.")] = False,
) -> int:
    if robot is not None:
        load_code_of_run(folder, given_files(controller, behavior, sensor))
        return _compare(folder, robot, as_json)
    from lfa.deploy.analysis.verification.playback import play

    return play(folder, speed, fleet, connect)


def journals(folder: Path, robot: str) -> list[Path]:
    """Return the journals of all incarnations of `robot` (id, name or `all`). Raises Refused when there is none."""
    number = whole_number(robot)
    name = robot if number is None else robot_name(number)
    found = sorted((folder / "journal").glob("*.bin"))
    paths = [path for path in found if name in ("all", path.stem.rpartition("-")[0])]
    if not paths:
        names = sorted({path.stem.rpartition("-")[0] for path in found})
        if not names:
            raise Refused(f"{folder}: holds no journal: must be a run folder")
        raise Refused(f"--robot {robot}: has no journal in {folder}, must be all or one of {', '.join(names)}")
    return paths


def _compare(folder: Path, robot: str, as_json: bool) -> int:
    """Compare the journals and print the result; return 0 if all outputs are equal, else 1."""
    from lfa.deploy.analysis.verification.reexecution import compare

    found = [compare(path) for path in journals(folder, robot)]
    if as_json:
        print_visible(msgspec.json.encode(found).decode())
    else:
        print_visible("\n".join(_text(comparison) for comparison in found))
    return 0 if all(comparison.equal for comparison in found) else 1


def _text(comparison: Comparison) -> str:
    difference = comparison.difference
    if difference is None:
        return f"{comparison.journal}: all {comparison.calls} calls return what they returned"
    head = (
        f"{comparison.journal}: call {difference.call} ({difference.what} at {difference.at:.6f} s) returns otherwise:"
    )
    return "\n".join([head, *(f"  {said}" for said in difference.now_returns or ["nothing"])])
