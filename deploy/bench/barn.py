"""`lfa bench barn`: the BARN navigation benchmark with the teams of this project, in virtual time.

Each world is a field of posts between two walls, which no robot knows. The score of one run is the benchmark's:
`success T / clip(time, 2 T, 8 T)` with T = shortest path / 2 m/s; the time counts from the first 0.1 m driven, success
is a robot within 1 m of the goal without a contact, and 0.5 is the most. The benchmark's own planner (DWA) is reported
with a score of 0.159 and a success of 0.85. The worlds are read from `shared/data/barn`, beside the checkout or above
it, or from `--worlds FILE`.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterable, Sequence
from functools import partial
from math import hypot
from pathlib import Path

import msgspec
from msgspec import Struct, to_builtins

from lfa.deploy.bench.harness.kept import Keep, measured_or_kept
from lfa.deploy.bench.harness.rows import Case, CasePart, Quantity, many, select, show
from lfa.deploy.bench.motion import complaint
from lfa.deploy.campaign.items import name_of
from lfa.protocol.errors import Refused

FOUND_IN = Path("shared") / "data" / "barn" / "worlds.json"
LEFT_M, RIGHT_M, BOTTOM_M, TOP_M = -4.35, -0.15, 0.15, 9.6
"""Walls [m] that stand for the rows of posts around the field."""
JACKAL_MPS, JACKAL_MPS2 = 2.0, 4.0
STARTED_M = 0.1
T_MIN, T_MAX = 2.0, 8.0
SCORE_BAR = 0.47
DRIVE = (
    f"mission.limits.v_max_mps={JACKAL_MPS}",
    f"mission.limits.a_max_mps2={JACKAL_MPS2}",
    "mission.limits.omega_max_radps=4.0",
    "mission.limits.alpha_max_radps2=20.0",
    f"mission.leading.cruise_mps={JACKAL_MPS}",
    f"mission.leading.acceleration_mps2={JACKAL_MPS2}",
)


class BarnWorld(Struct, frozen=True):
    """One world: centres of its posts, and the length of the shortest path on the benchmark's grid."""

    index: int
    shortest_path_m: float
    centers_m: tuple[tuple[float, float], ...]


class BarnWorlds(Struct, frozen=True):
    """File of worlds with a common start (x, y, theta) and goal in `map` [m, rad]."""

    start: tuple[float, float, float]
    goal: tuple[float, float]
    goal_tolerance_m: float
    time_limit_s: float
    obstacle_radius_m: float
    worlds: tuple[BarnWorld, ...]


class BarnTeam(Struct, frozen=True):
    """Team that drives through each world: its scenario keys, and whether the benchmark's score applies."""

    name: str
    sets: tuple[str, ...]
    scored: bool = True
    faults: tuple[str, ...] = ()
    good_share: float = 1.0


BODY = "mission.radius_m=0.25"
COLUMN_OF_THREE = (
    "mission.robots=[1, 2, 3]",
    "mission.formation.side=column",
    "mission.formation.separation_m=0.8",
    "mission.following.trace=true",
)
TEAMS = (
    BarnTeam("one", (BODY, *DRIVE)),
    BarnTeam("jackal_circle", ("mission.radius_m=0.333", *DRIVE), good_share=0.96),
    BarnTeam("path_following", (BODY, "mission.leading.motion=path_following"), scored=False, good_share=0.95),
    BarnTeam("point_to_point", (BODY, "mission.leading.motion=point_to_point"), scored=False, good_share=0.95),
    BarnTeam("reactive", (BODY, "mission.leading.motion=reactive"), scored=False, good_share=0.8),
    BarnTeam("leader_killed", (BODY, *COLUMN_OF_THREE), False, ("kill leader at 12 s",), good_share=0.95),
)


def run(
    as_json: bool,
    rows: str = "*",
    jobs: int = 1,
    seeds: int | None = None,
    worlds: str | None = None,
    keep: Keep | None = None,
) -> int:
    """Print the rows whose names match the glob `rows`, over the first `seeds` worlds; return 0 if all hold, else 1."""
    field = read(_file() if worlds is None else Path(worlds))
    chosen = field.worlds[: seeds or len(field.worlds)]
    return show(
        measured_or_kept("barn", select([case(team, field, chosen) for team in TEAMS], rows), jobs, rows, keep), as_json
    )


def case(team: BarnTeam, field: BarnWorlds, worlds: Sequence[BarnWorld]) -> Case:
    """Return the case of one team over `worlds`."""
    good = Quantity(f"good of {len(worlds)}", "runs", float(int(team.good_share * len(worlds))), "at least")
    contacts = Quantity("contacts", "runs", 0.0)
    score = (Quantity("score", "", SCORE_BAR, "at least", over="mean"),) if team.scored else ()
    parts = [
        CasePart([world.index, name_of(to_builtins(world))], partial(result, team, field, world)) for world in worlds
    ]
    return many(f"barn/{team.name}", (good, contacts, *score), parts)


def result(team: BarnTeam, field: BarnWorlds, world: BarnWorld) -> list[float]:
    """Return whether the run was good and whether it had a contact (0 or 1), and where it is scored the score."""
    score, wrong, contact = outcome(team, field, world)
    print(f"barn/{team.name} {world.index}: {wrong or 'ok'}, score {score:.3f}", file=sys.stderr, flush=True)
    return [float(wrong is None), float(contact)] + ([score] if team.scored else [])


def outcome(team: BarnTeam, field: BarnWorlds, world: BarnWorld) -> tuple[float, str | None, bool]:
    """Return the score of one run, the reason why it is not good (None: it is), and whether there was a contact."""
    from lfa.deploy.simulate import run as simulated
    from lfa.world.description.load import load

    folder = Path(tempfile.mkdtemp(prefix="lfa-barn-"))
    try:
        path = folder / f"barn_{world.index}.toml"
        path.write_text(scenario_text(field, world))
        scenario = load(str(path), team.sets)
        done = simulated(scenario, seed=world.index, out=folder / "run", faults=team.faults)
        wrong = complaint(done.summary)
        contact = any(robot.contacts for robot in done.summary.robots)
        took_s = time_s(done.truth[scenario.mission.robots[0]], field)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return 0.0 if wrong is not None else score_of(world.shortest_path_m, took_s), wrong, contact


def score_of(shortest_path_m: float, took_s: float) -> float:
    """Return the benchmark's score of a successful run that took `took_s` [s]."""
    shortest_s = shortest_path_m / JACKAL_MPS
    return shortest_s / min(max(took_s, T_MIN * shortest_s), T_MAX * shortest_s)


def scenario_text(field: BarnWorlds, world: BarnWorld) -> str:
    """Return the scenario file of one world, for one robot that explores it."""
    inside = [(x, y) for x, y in world.centers_m if LEFT_M < x < RIGHT_M and y > BOTTOM_M]
    posts = ", ".join(f"{{ center_m = [{x}, {y}], radius_m = {field.obstacle_radius_m} }}" for x, y in inside)
    (x, y, theta), (goal_x, goal_y) = field.start, field.goal
    return f"""title = "BARN world {world.index}"
time_limit_s = {field.time_limit_s}
[mission]
robots = [1]
[mission.leading]
motion = "explore"
route_m = [[{x}, {y}], [{goal_x}, {goal_y}]]
[world]
start = [{x}, {y}, {theta}]
walls_m = [[{LEFT_M}, {BOTTOM_M}, {LEFT_M}, {TOP_M}], [{RIGHT_M}, {BOTTOM_M}, {RIGHT_M}, {TOP_M}], \
[{LEFT_M}, {BOTTOM_M}, {RIGHT_M}, {BOTTOM_M}]]
obstacles = [{posts}]
"""


def read(path: Path) -> BarnWorlds:
    """Read a file of worlds. Raises `Refused` with one line if that is impossible."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=BarnWorlds)
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}: must be a file of BARN worlds (--worlds FILE)") from error
    except msgspec.DecodeError as error:
        raise Refused(f"{path}: {error}: must be BARN worlds in JSON") from error


def _file() -> Path:
    above = (*Path.cwd().parents, *Path(__file__).resolve().parents)
    found = next((path for up in above if (path := up / FOUND_IN).is_file()), None)
    if found is None:
        raise Refused(f"no {FOUND_IN} beside the checkout or above it: name the worlds with --worlds FILE")
    return found


def time_s(truth: Iterable[Sequence[float]], field: BarnWorlds) -> float:
    """Return the time [s] from the first 0.1 m driven until the robot is within the goal's tolerance; inf if never."""
    started = None
    for t, x, y, *_ in truth:
        if started is None and hypot(x - field.start[0], y - field.start[1]) >= STARTED_M:
            started = t
        if started is not None and hypot(x - field.goal[0], y - field.goal[1]) <= field.goal_tolerance_m:
            return float(t - started)
    return float("inf")
