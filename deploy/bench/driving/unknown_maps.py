"""Maps that the robots do not know, and random pairs of start and goal on them.

Maps of others are searched in `shared`, beside the checkout or above it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import hypot
from pathlib import Path
from random import Random

from msgspec import Struct

from lfa.protocol.errors import Refused

TRIES_MAX = 4000


class BenchMap(Struct, frozen=True):
    """Map that the robots do not know, and the parameters of the start and goal pairs drawn on it."""

    name: str
    place: str | None = None
    """The map's YAML file in the folder `shared`; None: shipped with the scenarios."""
    robots: int = 4
    apart_m: float = 8.0
    """Minimum straight distance [m] between start and goal; no route is shorter."""
    clear_m: float = 0.45
    """Minimum clearance [m] of start and goal."""
    pairs: int = 20
    sets: tuple[str, ...] = ()


GROUNDS = (
    BenchMap("rooms"),
    BenchMap("depot", "data/maps/depot.yaml"),
    BenchMap(
        "tb3_sandbox",
        "data/maps/tb3_sandbox.yaml",
        robots=2,
        apart_m=3.0,
        clear_m=0.25,
        pairs=10,
        sets=("mission.formation.separation_m=0.6",),
    ),
    BenchMap("room16", "cases/driving/maps/room16.yaml", pairs=10, sets=("time_limit_s=500",)),
)


def map_of(ground: BenchMap) -> Path | None:
    """Return the path of the map's YAML file, or None if it does not exist."""
    from lfa.world.description.load import SCENARIOS

    if ground.place is None:
        return SCENARIOS / "maps" / f"{ground.name}.yaml"
    above = (*Path.cwd().parents, *Path(__file__).resolve().parents)
    return next((path for up in above if (path := up / "shared" / ground.place).is_file()), None)


@cache
def pairs(ground: BenchMap, count: int) -> list[tuple[str, ...]]:
    """Return up to `count` random pairs in free space, each as arguments of `--set`.

    The scenario `explore` must load with each pair: the chain fits at the start, and a route leads to the goal.
    """
    from lfa.world.description import maps
    from lfa.world.description.load import load

    path = map_of(ground)
    assert path is not None, ground
    drawn = maps.read(path)
    room, chance, found = maps.Room(drawn), Random("pairs"), list[tuple[str, ...]]()
    free = [(int(row), int(column)) for row, column in zip(*(drawn.cells == 0).nonzero(), strict=True)]
    sets = ground.sets if ground.place is None else (f"map={path}", *ground.sets)
    for _ in range(TRIES_MAX):
        if len(found) == count:
            break
        a, b = (
            drawn.to_map((column + chance.random()) * drawn.resolution_m, (row + chance.random()) * drawn.resolution_m)
            for row, column in chance.choices(free, k=2)
        )
        clear_m = min(room.clearance_m(*a), room.clearance_m(*b))
        if hypot(a[0] - b[0], a[1] - b[1]) < ground.apart_m or clear_m < ground.clear_m:
            continue
        pair = (*sets, f"start={a[0]:.2f},{a[1]:.2f}", f"goal={b[0]:.2f},{b[1]:.2f}")
        try:
            load("explore", pair, ground.robots)
        except Refused:
            continue
        found.append(pair)
    return found


def shortest_on(ground: BenchMap, pair: Sequence[str], robot_m: float) -> float:
    """Return the length [m] of the shortest way of a pair for who knows the map, for a robot of radius `robot_m`."""
    from lfa.deploy.bench.driving.shortest_way import shortest_m
    from lfa.world.description import maps

    path = map_of(ground)
    assert path is not None, ground
    (sx, sy), (gx, gy) = (map(float, word.partition("=")[2].split(",")) for word in pair[-2:])
    return shortest_m(maps.read(path), (sx, sy), (gx, gy), robot_m)
