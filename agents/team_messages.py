"""What a robot takes from the messages of the others in its team: positions, clocks, obstacles, the formation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lfa.agents.leading.formation_commands import FormationCommands
from lfa.agents.navigator import Navigator
from lfa.agents.team_state import TeamState
from lfa.protocol.messages.team import FormationNote, ObstacleNote, PoseStamped, TableRow

TeamMessage = PoseStamped | TableRow | ObstacleNote | FormationNote


class TeamMessages:
    """Receiver of the other robots' messages; `event` publishes an event of this robot: kind, time [s], data."""

    def __init__(
        self,
        robot_id: int,
        navigator: Navigator,
        team: TeamState,
        formation_commands: FormationCommands,
        event: Callable[[str, float, dict[str, Any]], None],
    ) -> None:
        self._id = robot_id
        self._navigator = navigator
        self._team = team
        self._formation_commands = formation_commands
        self._event = event

    def hear(self, robot: int, message: TeamMessage, now: float) -> None:
        """Update the state from a message of another robot."""
        navigator = self._navigator
        ahead = navigator.predecessor
        if ahead is not None and ahead.robot != robot:
            ahead = None
        match message:
            case PoseStamped():
                if ahead is not None:
                    ahead.heard(message, now)
            case TableRow():
                self._team.hear_row(robot, message, now)
                if ahead is not None:  # the row of each other robot of a large team is only noted
                    least_s = next((delay.least_s for delay in message.delays if delay.robot == self._id), None)
                    if least_s is not None:
                        ahead.clock.reported(least_s, now)
            case ObstacleNote(kind="trap"):
                navigator.avoid_trap(message)
            case ObstacleNote():
                self._team.obstacles.update(robot, message, now)
            case FormationNote():
                if navigator.formation.request(message):
                    self._formation_commands.hear(message)
                    self._event("formation", now, {"number": message.number, "trace": message.trace})
