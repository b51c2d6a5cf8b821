"""`lfa campaign PLAN`: the runs of a plan, or a share of them; `lfa campaign merge DIR...`: their results, joined."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lfa.agents.following.plugin import add_controller_file
from lfa.deploy.campaign.commands.merge import merge
from lfa.deploy.campaign.commands.sweep import carry_out
from lfa.deploy.campaign.shard import WHOLE, parse_shard
from lfa.deploy.campaign.sweep.plan import RUNS_MAX, read_plan
from lfa.protocol.errors import Refused

MERGE = "merge"


def command(
    words: Annotated[list[str], typer.Argument(metavar="PLAN | merge DIR...", help="A plan, or folders to merge.")],
    jobs: Annotated[int, typer.Option(help="Number of parallel processes.")] = 1,
    shard: Annotated[str | None, typer.Option(help="Do only this share of the runs: 3/16.")] = None,
    controller: Annotated[
        list[str] | None, typer.Option(help="Load a controller that the plan names: FILE.py:Class. Repeatable.")
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
    for own_code in controller or ():
        add_controller_file(own_code)
    share = WHOLE if shard is None else parse_shard(shard)
    return carry_out(read_plan(Path(words[0]), max_runs), out, share, jobs, as_json)
