"""Loading of the requested scenario, with all checks that are possible before a process starts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from msgspec.structs import replace

from lfa.deploy.recording.run_folder import SCENARIO
from lfa.deploy.scenario_loading import load_scenario
from lfa.protocol.errors import Refused
from lfa.protocol.mission_checks import check_mission
from lfa.world.description.load import Scenario


def rebuild_scenario(
    scenario: str, overrides: Sequence[str], robots: int | None, seed: int | None, map_from: Path | None
) -> tuple[Scenario, int]:
    """Return the scenario and the seed (the scenario's by default); with `map_from`, prepare the paper's iteration 2.

    Iteration 2 is the world of the earlier run in that folder (with its seed, unless another is given), with the
    obstacles that its robots met as known obstacles of the team. Raises Refused with one line.
    """
    chosen = load_scenario(scenario, overrides, robots)
    if map_from is None:
        return chosen, chosen.seed if seed is None else seed
    from lfa.deploy.analysis import summary  # both read recordings: numpy
    from lfa.deploy.analysis.known_obstacles import known_obstacles

    earlier = summary.read(map_from) if (map_from / summary.SUMMARY).is_file() else None
    if earlier is not None and chosen.name not in (earlier.scenario, Path(SCENARIO).stem):  # or the earlier run's own
        raise Refused(f"--map-from {map_from}: a run of {earlier.scenario}, must be one of {chosen.name}")
    leading = replace(chosen.mission.leading, known_m=known_obstacles(map_from))
    try:
        mission = check_mission(replace(chosen.mission, leading=leading))
    except Refused as refused:
        raise Refused(f"{scenario} with --map-from {map_from}: {refused}") from None
    known_seed = 0 if earlier is None else earlier.seed
    return replace(chosen, mission=mission), known_seed if seed is None else seed
