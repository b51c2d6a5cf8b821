"""`lfa campaign PLAN`: the runs of a plan, or a share of them; `lfa campaign merge DIR...`: their results, joined."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lfa.deploy.campaign.commands.merge import merge
from lfa.deploy.campaign.commands.sweep import Remote, carry_out, carry_out_on
from lfa.deploy.campaign.engines.dispatch import check_engine
from lfa.deploy.campaign.engines.kubernetes import manifest
from lfa.deploy.campaign.shard import SHARDS_MAX, WHOLE, parse_shard
from lfa.deploy.campaign.sweep.plan import RUNS_MAX, read_plan
from lfa.deploy.own_code import load_file
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused

MERGE = "merge"
LOCAL = "local"
SHARES = 4
MINUTES = 60


def command(
    words: Annotated[list[str], typer.Argument(metavar="PLAN | merge DIR...", help="A plan, or folders to merge.")],
    jobs: Annotated[int, typer.Option(help="Number of parallel processes, of each share.")] = 1,
    shard: Annotated[str | None, typer.Option(help="Do only this share of the runs: 3/16.")] = None,
    on: Annotated[
        str, typer.Option(help="Where: local, slurm, dask://HOST:PORT, or kubernetes (prints a Job).")
    ] = LOCAL,
    shards: Annotated[int, typer.Option(help="With --on: number of shares.")] = SHARES,
    minutes: Annotated[int, typer.Option(help="With --on slurm: time limit of a share [min].")] = MINUTES,
    slurm: Annotated[
        list[str] | None, typer.Option(help="With --on slurm: an option of sbatch, partition=short. Repeatable.")
    ] = None,
    controller: Annotated[
        list[str] | None, typer.Option(help="Load a controller that the plan names: FILE.py:Class. Repeatable.")
    ] = None,
    behavior: Annotated[
        list[str] | None, typer.Option(help="Load a behaviour that the plan names: FILE.py:Class. Repeatable.")
    ] = None,
    sensor: Annotated[
        list[str] | None, typer.Option(help="Load a sensor that the plan names: FILE.py:Class. Repeatable.")
    ] = None,
    generator: Annotated[
        list[str] | None, typer.Option(help="Load a generator that the plan names: FILE.py:Class. Repeatable.")
    ] = None,
    max_runs: Annotated[int, typer.Option(help="Refuse a plan of more runs than this.")] = RUNS_MAX,
    out: Annotated[Path | None, typer.Option(help="Folder of the results; default runs/<title>-<hash>.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print counts and paths as JSON.")] = False,
) -> int:
    """Run a plan or merge results; exit with code 1 if a run failed or is missing."""
    if words[0] == MERGE:
        if len(words) < 2 or shard is not None:
            raise Refused("lfa campaign merge DIR...: must name the folders to merge, and takes no --shard")
        return merge([Path(word) for word in words[1:]], out, as_json)
    if len(words) != 1:
        raise Refused(f"lfa campaign {' '.join(words)}: must be one plan, or merge DIR...")
    if on != LOCAL and shard is not None:
        raise Refused(f"--on {on} with --shard {shard}: must be one of the two")
    _refuse_numbers(shards, jobs, minutes, max_runs)
    check_engine(on)
    share = WHOLE if shard is None else parse_shard(shard)
    own_code = _load_all({"controller": controller, "behavior": behavior, "sensor": sensor, "generator": generator})
    path = Path(words[0])
    plan = read_plan(path, max_runs)
    if on == LOCAL:
        return carry_out(plan, out, share, jobs, as_json)
    if on == "kubernetes":
        print_visible(manifest(path, shards, jobs), end="")
        return 0
    more = [word for kind, text in own_code for word in (f"--{kind}", str(Path(text).absolute()))]
    remote = Remote(on, shards, jobs, minutes, _pairs(slurm or ()), [*more, "--max-runs", str(max_runs)])
    return carry_out_on(remote, path, plan, out, as_json)


def _pairs(texts: list[str] | tuple[()]) -> dict[str, str]:
    """Return options of sbatch by name. Raises Refused for a text without a value."""
    for text in texts:
        if not text.partition("=")[2]:
            raise Refused(f"--slurm {text}: must be like partition=short")
    return {key: value for key, _, value in (text.partition("=") for text in texts)}


def _refuse_numbers(shards: int, jobs: int, minutes: int, max_runs: int) -> None:
    """Raise Refused for a number of shares, processes, minutes or runs that is too small or too large."""
    if not 1 <= shards <= SHARDS_MAX or jobs < 1 or minutes < 1:
        raise Refused(f"--shards {shards} --jobs {jobs} --minutes {minutes}: each must be at least 1")
    if max_runs < 1:
        raise Refused(f"--max-runs {max_runs}: must be at least 1")


def _load_all(given: dict[str, list[str] | None]) -> list[tuple[str, str]]:
    """Load the classes that the options name, FILE.py:Class by kind; return each with its kind, as it was given."""
    own_code = [(kind, text) for kind, texts in given.items() for text in texts or ()]
    for kind, text in own_code:
        load_file(kind, text)
    return own_code
