"""`lfa bench barn`: the BARN navigation benchmark with the teams of this project, in virtual time.

Each world is a field of posts between two walls, which no robot knows. The score of one run is the benchmark's:
`success T / clip(time, 2 T, 8 T)` with T = shortest path / 2 m/s; the time counts from the first 0.1 m driven, success
is a robot within 1 m of the goal without a contact, and 0.5 is the most. Beside the teams stands what is published of
the benchmark's own planner (DWA). A chain whose leader is killed half-way must reach the goal wherever there is a way
past the dead robot, by a planner that knows the world. The worlds are read from `shared/data/barn`, beside the checkout
or above it, or from `--worlds FILE`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from math import hypot
from pathlib import Path
from time import strftime
from typing import NamedTuple

from msgspec import Struct, to_builtins

from lfa.deploy.bench.driving.one_run import complaint, driven, loaded, note, show_failures
from lfa.deploy.bench.harness.kept import Keep, measured_or_kept
from lfa.deploy.bench.harness.rows import Case, CasePart, Quantity, many, select, show
from lfa.deploy.bench.harness.way_past import Corridor, way_exists
from lfa.deploy.campaign.items import name_of
from lfa.deploy.recording import mcap_reader
from lfa.deploy.recording.mcap_reader import Array
from lfa.deploy.recording.run_folder import RUNS
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import read_given_json

FOUND_IN = Path("shared") / "data" / "barn" / "worlds.json"
LEFT_M, RIGHT_M, BOTTOM_M, TOP_M = -4.35, -0.15, 0.15, 9.6
CORRIDOR = Corridor(LEFT_M, RIGHT_M, BOTTOM_M, TOP_M)
"""Walls [m] that stand for the rows of posts around the field."""
JACKAL_MPS, JACKAL_MPS2 = 2.0, 4.0
STARTED_M = 0.1
T_MIN, T_MAX = 2.0, 8.0
SCORE_BAR = 0.49
NOISY_SCORE_BAR = 0.98 * SCORE_BAR
RADIUS_M = 0.25
BASELINE = ((Quantity("success", "share"), 0.85), (Quantity("score", ""), 0.159))
"""Published results of the benchmark's own planner, over 500 runs."""
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
    score_bar: float | None = None


NOISE = (
    "world.noise.localization_m=0.005",
    "world.noise.localization_rad=0.0087",
    "world.noise.odometry=0.01",
    "world.noise.range_m=0.005",
    "world.noise.range_dropout=0.002",
)
"""Noise of the shipped scenario `explore`."""
JACKAL = (
    "mission.radius_m=0.333",
    "world.body.footprint_m=[[0.254, 0.215], [-0.254, 0.215], [-0.254, -0.215], [0.254, -0.215]]",
    "world.lidar.fov_rad=4.712389",
    "world.lidar.beams=270",
    "world.lidar.mount=[0.12, 0.0, 0.0]",
)
"""A Jackal with its scanner of 270 degrees ahead of its centre, with a beam a degree."""
BODY = f"mission.radius_m={RADIUS_M}"
COLUMN_OF_THREE = (
    "mission.robots=[1, 2, 3]",
    "mission.formation.side=column",
    "mission.formation.separation_m=0.8",
    "mission.following.trace=true",
)
TEAMS = (
    BarnTeam("one", (BODY, *DRIVE), score_bar=SCORE_BAR),
    BarnTeam("one_noisy", (BODY, *DRIVE, *NOISE), score_bar=NOISY_SCORE_BAR),
    BarnTeam("jackal_circle", ("mission.radius_m=0.333", *DRIVE), good_share=0.96),
    BarnTeam("jackal_rectangle", (*JACKAL, *DRIVE), good_share=0.96),
    BarnTeam("path_following", (BODY, "mission.leading.motion=path_following"), scored=False, good_share=0.95),
    BarnTeam("point_to_point", (BODY, "mission.leading.motion=point_to_point"), scored=False, good_share=0.95),
    BarnTeam("reactive", (BODY, "mission.leading.motion=reactive"), scored=False, good_share=0.8),
    BarnTeam("chain", (BODY, *COLUMN_OF_THREE), scored=False, good_share=0.95),
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
    """Print the rows whose names match the glob `rows`, over the first `seeds` worlds, then the failures by cause;
    return 0 if all hold, else 1.
    """
    failed = RUNS / f"barn-{strftime('%Y%m%d-%H%M%S')}"
    chosen = select([baseline(), *cases(seeds, worlds, failed)], rows)
    code = show(measured_or_kept("barn", chosen, jobs, rows, keep), as_json)
    show_failures(failed, as_json)
    return code


def cases(seeds: int | None, worlds: str | None, failed: Path) -> list[Case]:
    """Return the case of each team over the first `seeds` worlds of the file `worlds`; None: all, of the usual file.

    Failing runs leave their folders in `failed`. Raises Refused without a file of worlds.
    """
    field = read(found() if worlds is None else Path(worlds))
    return [case(team, field, field.worlds[: seeds or len(field.worlds)], failed) for team in TEAMS]


def case(team: BarnTeam, field: BarnWorlds, worlds: Sequence[BarnWorld], failed: Path) -> Case:
    """Return the case of one team over `worlds`."""
    named = "good, or no way left, of" if team.faults else "good of"
    good = Quantity(f"{named} {len(worlds)}", "runs", float(int(team.good_share * len(worlds))), "at least")
    contacts = Quantity("contacts", "runs", 0.0)
    score = (Quantity("score", "", team.score_bar, "at least", over="mean"),) if team.scored else ()
    parts = [
        CasePart([world.index, name_of(to_builtins(world))], partial(result, team, field, world, failed))
        for world in worlds
    ]
    return many(f"barn/{team.name}", (good, contacts, *score), parts)


def baseline() -> Case:
    """Return the published results of the benchmark's own planner as rows without a bar."""
    return Case("barn/published baseline (DWA)", tuple(q for q, _ in BASELINE), partial(list, [v for _, v in BASELINE]))


def result(team: BarnTeam, field: BarnWorlds, world: BarnWorld, failed: Path) -> list[float]:
    """Return whether the run was good and whether it had a contact (0 or 1), and where it is scored the score.

    After a fault a run is also good where the dead robot leaves no way.
    """
    done = outcome(team, field, world, failed)
    good = done.wrong is None or (bool(team.faults) and not done.passable)
    return [float(good), float(done.contact)] + ([done.score] if team.scored else [])


class BarnOutcome(NamedTuple):
    """Result of one run: its score, why it is not good (None: it is), and whether there was a contact."""

    score: float
    wrong: str | None
    contact: bool
    passable: bool
    """True if there is a way from the next robot past the first one, where that stood at the end, to the goal."""


def outcome(team: BarnTeam, field: BarnWorlds, world: BarnWorld, failed: Path) -> BarnOutcome:
    """Do one run of the team in the world; where it is not good, its folder stays in `failed`."""
    scenario = loaded(f"barn_{world.index}", scenario_text(field, world), team.sets)
    first = scenario.mission.robots[0]
    with driven(scenario, world.index, team.faults) as done:
        wrong, truth = complaint(done.summary), mcap_reader.read(done.folder).truth
        passable = _passable(field, world, [truth[robot] for robot in scenario.mission.robots])
        note(f"barn/{team.name}", done, wrong if wrong is None or passable else f"no way left: {wrong}", failed)
    score = 0.0 if wrong is not None else score_of(world.shortest_path_m, time_s(truth[first], field))
    contact = any(robot.contacts for robot in done.summary.robots)
    return BarnOutcome(score, wrong, contact, passable)


def _passable(field: BarnWorlds, world: BarnWorld, truth: Sequence[Array]) -> bool:
    """Return whether a way leads from the second robot past the first one, where that stood at the end, to the goal;
    True for one robot. `truth` has a robot's rows of t [s], x, y [m] each, in the order of the chain.
    """
    if len(truth) < 2:
        return True
    dead, stood = truth[0][-1], truth[1]
    at = min(range(len(stood)), key=lambda n: hypot(stood[n][1] - dead[1], stood[n][2] - dead[2]))
    discs = [(x, y, field.obstacle_radius_m) for x, y in inside(world)] + [(dead[1], dead[2], RADIUS_M)]
    return way_exists((stood[at][1], stood[at][2]), field.goal, discs, CORRIDOR, RADIUS_M)


def score_of(shortest_path_m: float, took_s: float) -> float:
    """Return the benchmark's score of a successful run that took `took_s` [s]."""
    shortest_s = shortest_path_m / JACKAL_MPS
    return shortest_s / min(max(took_s, T_MIN * shortest_s), T_MAX * shortest_s)


def scenario_text(field: BarnWorlds, world: BarnWorld) -> str:
    """Return the scenario file of one world, for one robot that explores it."""
    radius_m = field.obstacle_radius_m
    posts = ", ".join(f"{{ center_m = [{x}, {y}], radius_m = {radius_m} }}" for x, y in inside(world))
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


def inside(world: BarnWorld) -> list[tuple[float, float]]:
    """Return the centres [m] of the posts between the walls; those of the rim are the walls themselves."""
    return [(x, y) for x, y in world.centers_m if LEFT_M < x < RIGHT_M and y > BOTTOM_M]


def read(path: Path) -> BarnWorlds:
    """Read a file of worlds. Raises `Refused` with one line if that is impossible."""
    return read_given_json(path, BarnWorlds, "must be BARN worlds in JSON (--worlds FILE)")


def found() -> Path:
    """Return the usual file of worlds. Raises Refused if there is none."""
    above = (*Path.cwd().parents, *Path(__file__).resolve().parents)
    file = next((path for up in above if (path := up / FOUND_IN).is_file()), None)
    if file is None:
        raise Refused(f"no {FOUND_IN} beside the checkout or above it: name the worlds with --worlds FILE")
    return file


def time_s(truth: Iterable[Sequence[float]], field: BarnWorlds) -> float:
    """Return the time [s] from the first 0.1 m driven until the robot is within the goal's tolerance; inf if never."""
    started = None
    for t, x, y, *_ in truth:
        if started is None and hypot(x - field.start[0], y - field.start[1]) >= STARTED_M:
            started = t
        if started is not None and hypot(x - field.goal[0], y - field.goal[1]) <= field.goal_tolerance_m:
            return float(t - started)
    return float("inf")
