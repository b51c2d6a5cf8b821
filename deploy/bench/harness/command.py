"""`lfa bench NAME`: one module per name in `deploy/bench`, each with `run(as_json, ...) -> exit code`.

The parameters of `run` define the other options of a bench (`rows`, `jobs`, `processes`, `kills`, `full`, `minutes`,
`seeds`).
"""

from __future__ import annotations

from importlib import import_module
from inspect import signature
from pathlib import Path
from pkgutil import iter_modules
from typing import Annotated, Any

import typer

from lfa.deploy.bench.harness.kept import Keep
from lfa.deploy.campaign.shard import WHOLE, parse_shard
from lfa.protocol.errors import Refused


def command(
    name: Annotated[str, typer.Argument(help="Bench to run, for example lidar.")],
    as_json: Annotated[
        bool, typer.Option("--json", help='Print {"rows": [...]} as JSON, each row with value, bar and ok.')
    ] = False,
    rows: Annotated[str | None, typer.Option(help="Run only rows whose names match this glob: 'clean/*'.")] = None,
    jobs: Annotated[int | None, typer.Option(help="Number of parallel measuring processes.")] = None,
    processes: Annotated[bool, typer.Option("--processes", help="Also measure with real processes.")] = False,
    figures: Annotated[str | None, typer.Option(help="Draw figures into this folder.")] = None,
    kills: Annotated[int | None, typer.Option(help="Number of rounds of each fault.")] = None,
    full: Annotated[bool, typer.Option("--full", help="Run many more rounds, and report the p99.")] = False,
    minutes: Annotated[float | None, typer.Option(help="Duration of a measurement [min].")] = None,
    worlds: Annotated[str | None, typer.Option(help="File of BARN worlds (barn).")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Keep the results here; a second start measures only what is missing.")
    ] = None,
    shard: Annotated[str | None, typer.Option(help="With --out: measure only this share, 3/16.")] = None,
    seeds: Annotated[
        int | None, typer.Option(help="Number of runs of each case, from seed 1; of pairs on each map, of BARN worlds.")
    ] = None,
) -> int:
    """Run a benchmark; exit with code 1 if a row misses its bar."""
    names = _names()
    if name not in names:
        raise Refused(f"no bench {name!r}: must be one of {', '.join(names)}")
    run = import_module(f"lfa.deploy.bench.{name}").run
    given: dict[str, Any] = {"rows": rows, "jobs": jobs, "processes": processes or None, "figures": figures}
    given |= {"kills": kills, "full": full or None, "minutes": minutes, "seeds": seeds, "worlds": worlds}
    if shard is not None and out is None:
        raise Refused(f"--shard {shard}: must go with --out, the folder of the results")
    if out is not None:
        given["keep"] = Keep(out, WHOLE if shard is None else parse_shard(shard))
    given = {option: value for option, value in given.items() if value is not None}
    for option in given:
        if option not in signature(run).parameters:
            raise Refused(f"lfa bench {name} takes no --{'out' if option == 'keep' else option}")
    if jobs is not None and jobs < 1:
        raise Refused(f"--jobs {jobs}: must be at least 1")
    if kills is not None and kills < 1:
        raise Refused(f"--kills {kills}: must be at least 1")
    if seeds is not None and seeds < 1:
        raise Refused(f"--seeds {seeds}: must be at least 1")
    if minutes is not None and not 0.0 < minutes < float("inf"):
        raise Refused(f"--minutes {minutes:g}: must be a finite number above 0")
    code: int = run(as_json, **given)
    return code


def _names() -> list[str]:
    """Return the names of the modules beside this folder that have a `run`; they are imported to find out."""
    modules = (module.name for module in iter_modules([str(Path(__file__).parents[1])]))
    return [name for name in modules if hasattr(import_module(f"lfa.deploy.bench.{name}"), "run")]
