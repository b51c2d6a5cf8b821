"""Goals that a fault orders, as an operator does by `lfa go`: refused where no leader can get."""

from __future__ import annotations

from lfa.deploy.client.mission_changes import along
from lfa.protocol.errors import Refused
from lfa.world.description.placement import gap_to
from lfa.world.description.scenario import Point, Scenario


def check_goal(scenario: Scenario, goal: Point) -> None:
    """Raise Refused for a goal [m] that no leader of `scenario` can reach."""
    mission = scenario.mission
    along((goal,), scenario.world.walls_m)(mission, mission)
    for obstacle in scenario.world.obstacles:
        if not obstacle.moves and obstacle.mass_kg is None and gap_to(goal, obstacle) < mission.radius_m:
            x, y = obstacle.center_m
            right = f"must be {mission.radius_m:g} m clear of it"
            raise Refused(f"goal ({goal[0]:g}, {goal[1]:g}): on the obstacle at ({x:g}, {y:g}), {right}")
