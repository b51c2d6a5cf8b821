"""`lfa export sdf` and `lfa export map`: the world of a scenario for Gazebo and other SDF readers, or as a ROS map."""

from __future__ import annotations

from pathlib import Path

from lfa.deploy.scenario_loading import load_scenario
from lfa.deploy.whole_output import whole_folder
from lfa.deploy.worlds.grid import grid_of
from lfa.deploy.worlds.sdf import sdf_of
from lfa.protocol.errors import Refused
from lfa.world.description import maps
from lfa.world.description.load import draw
from lfa.world.description.maps import Map
from lfa.world.description.scenario import Scenario

CELL_M, CELLS_MAX = 0.05, 16_000_000


def export_world(kind: str, name: str, folder: Path | None) -> tuple[Path, list[str]]:
    """Write the world of the scenario `name`, as its own seed draws it; return the folder and the files in it.

    What moves stands where it begins. Raises Refused.
    """
    scenario = load_scenario(name)
    drawn = draw(scenario, scenario.seed)
    place = folder or Path(f"{drawn.name}-{kind}")
    if place.exists() and (not place.is_dir() or any(place.iterdir())):
        raise Refused(f"--out {place}: must be a new or empty folder")
    try:
        with whole_folder(place) as fresh:
            if kind == "sdf":
                (fresh / "world.sdf").write_text(sdf_of(drawn), encoding="utf-8")
                return place, ["world.sdf"]
            maps.write(fresh / "map.yaml", map_of(drawn))
            return place, ["map.pgm", "map.yaml"]
    except OSError as error:
        raise Refused(f"--out {place}: cannot be written ({error.strerror})") from None


def map_of(drawn: Scenario) -> Map:
    """Return the ground of a drawn scenario as an occupancy map, starts and goal within it."""
    starts = [(x, y) for x, y, _ in drawn.world.starts or ()]
    return grid_of(
        drawn.world.walls_m, drawn.world.obstacles, [*starts, *drawn.mission.leading.route_m], CELL_M, CELLS_MAX
    )
