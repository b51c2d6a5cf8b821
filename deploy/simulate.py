"""A scenario from a notebook or a script:

from deploy.simulate import run

done = run("paper_path1", seed=7, set=["mission.leading.cruise_mps=0.4"], faults=["kill leader at 9 s"])
t, x, y, theta, v, omega = done.truth[2].T       # numpy: s, m, m, rad, m/s, rad/s in map
error_m = done.errors[2].distance                # of follower 2, at done.errors[2].t
done.figure("fig07_distance_error")              # matplotlib; a notebook shows it
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from deploy.look.readings import Run
from deploy.run import simulate
from deploy.run.faults import parse_all
from world.scenario import Scenario, load

__all__ = ["Run", "run"]


def run(
    scenario: str | Scenario,
    *,
    seed: int = 0,
    set: Sequence[str] = (),
    robots: int | None = None,
    faults: Sequence[str] = (),
    out: Path | None = None,
) -> Run:
    """Run `scenario` (shipped name, file, or as loaded) in virtual time, as `lfa sim` does, and read the result.

    `set` holds texts `a.b=value` and `robots` a team's size, for a scenario given by name. The run folder is `out`,
    or a new one in `runs/`. Raises Refused for what no world could be built from.
    """
    chosen = load(scenario, set, robots) if isinstance(scenario, str) else scenario
    ended = simulate.run(chosen, seed, out, parse_all(chosen.mission, chosen.faults, faults))
    return Run(ended.folder)
