"""Run a scenario from a notebook or a script:

```python
from lfa.deploy.simulate import run

done = run("paper_path1", seed=7, set=["mission.leading.cruise_mps=0.4"], faults=["kill leader at 9 s"])
t, x, y, theta, v, omega = done.truth[2].T       # numpy: s, m, m, rad, m/s, rad/s in map
error_m = done.errors[2].distance                # of follower 2, at done.errors[2].t
done.figure("fig07_distance_error")              # matplotlib; a notebook shows it
```

`environment` makes the same runs into an environment for learners.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from lfa.deploy.analysis.run_data import Run
from lfa.deploy.faults.script import parse_all
from lfa.deploy.robot.driver import Driver, MakeBase
from lfa.deploy.run import simulate
from lfa.protocol.errors import Refused
from lfa.world.description.load import Scenario, load
from lfa.world.description.own_sensor import INSTALLED_RULE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from lfa.deploy.learn.robot_environment import RobotEnvironment
    from lfa.deploy.learn.team_environment import TeamEnvironment

__all__ = ["Result", "environment", "read", "robot_environment", "run"]


class Result(Run):
    """Data of a finished run, with its figures for a notebook."""

    def figure(self, name: str) -> Figure:
        """Return the figure `name` of `catalogue.FIGURES`. Raises KeyError that lists the known names."""
        from lfa.deploy.view.figures import catalogue

        if name not in (known := [known for known, *_ in catalogue.FIGURES]):
            raise KeyError(f"{name}: must be one of {', '.join(known)}")
        return catalogue.drawn(name, self)


def run(
    scenario: str | Scenario,
    *,
    seed: int | None = None,
    set: Sequence[str] = (),
    robots: int | None = None,
    faults: Sequence[str] = (),
    out: Path | None = None,
    drivers: Mapping[int, MakeBase] | None = None,
) -> Result:
    """Run `scenario` (shipped name, file, or loaded) in virtual time, as `lfa sim` does, and return its result.

    `seed` is the scenario's own by default. `set` (texts `a.b=value`) and `robots` (team size) override a scenario that
    is given by name. The run folder is `out`, or a new one in `runs/`. `drivers` has the hardware of robots that the
    world does not simulate, by id: each is driven through a `Driver`. Raises Refused for a scenario that no world can
    be built from.
    """
    chosen = load(scenario, set, robots, (INSTALLED_RULE,)) if isinstance(scenario, str) else scenario
    hardware = drivers or {}
    if hardware:
        world = replace(chosen.world, real_robots=tuple(sorted(hardware)))
        chosen = replace(chosen, world=world, mission=replace(chosen.mission, cold_start="full_house"))
    nodes = [Driver(simulate.FLEET, robot, 1, make_base) for robot, make_base in hardware.items()]
    drawn_with = chosen.seed if seed is None else seed
    ended = simulate.run(chosen, drawn_with, out, parse_all(chosen.mission, chosen.faults, faults), nodes)
    return Result(ended.folder)


def read(folder: Path) -> Result:
    """Return the result of a run that was recorded earlier, by `run`, `lfa sim`, `lfa run` or `lfa record`.

    Raises Refused for a folder that is none, or that another version wrote.
    """
    return Result(folder)


def environment(
    scenario: str | Scenario,
    commanded: Sequence[int] | None = None,
    *,
    set: Sequence[str] = (),
    robots: int | None = None,
    faults: Sequence[str] = (),
    step_s: float = 0.1,
) -> TeamEnvironment:
    """Return `scenario` as a PettingZoo `ParallelEnv` in virtual time, whose agents are the robots `commanded`.

    `commanded` are ids, by default all; the agents' names are `robot1`, `robot2`, ... Actions are twists (m/s, rad/s),
    held for `step_s` [s]; robots without one drive as always. `set`, `robots` and `faults` are those of `run`. Raises
    Refused for a bad argument, and without the extra `learn`.
    """
    chosen = load(scenario, set, robots) if isinstance(scenario, str) else scenario
    try:
        from lfa.deploy.learn.team_environment import TeamEnvironment
    except ModuleNotFoundError as error:
        raise Refused(f"an environment needs {error.name}: install with: pip install 'lfa[learn]'") from None
    if not (commanded is None or isinstance(commanded, Sequence)):
        raise Refused(f"commanded={commanded!r}: must be a list of robots, of {list(chosen.mission.robots)}")
    ids = chosen.mission.robots if commanded is None else tuple(commanded)
    return TeamEnvironment(chosen, ids, parse_all(chosen.mission, chosen.faults, faults), step_s)


def robot_environment(
    scenario: str | Scenario,
    robot: int,
    *,
    set: Sequence[str] = (),
    robots: int | None = None,
    faults: Sequence[str] = (),
    step_s: float = 0.1,
) -> RobotEnvironment:
    """Return `scenario` as a Gymnasium `Env` of the one robot `robot`; else as `environment`."""
    team = environment(scenario, (robot,), set=set, robots=robots, faults=faults, step_s=step_s)
    from lfa.deploy.learn.robot_environment import RobotEnvironment

    return RobotEnvironment(team)
