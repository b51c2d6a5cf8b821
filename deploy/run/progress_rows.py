"""Text of a run's progress from the state of its fleet: a headline and a row for each robot."""

from __future__ import annotations

from math import hypot

from lfa.deploy.client.fleet_state import FleetState
from lfa.deploy.client.term_count import TermCount
from lfa.protocol.names import robot_name


class ProgressRows:
    """Progress as text; times are world time [s]. `gone` are the robots whose process has ended."""

    def __init__(self, robots: tuple[int, ...], state: FleetState) -> None:
        self._robots = robots
        self._state = state
        self._terms = TermCount()
        self.gone: set[int] = set()

    @property
    def time_s(self) -> float:
        return 0.0 if self._state.truth is None else self._state.truth.time_s

    def headline(self, leader: int | None) -> str:
        who = "no leader yet" if leader is None else f"leader {leader}, term {self._terms.number(self._state.term)}"
        return f"{self.time_s:7.1f} s  {who}"

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Return name, role, distance error and state of each robot."""
        return [(robot_name(robot), self._role(robot), self._error(robot), self._text(robot)) for robot in self._robots]

    def line(self, leader: int | None) -> str:
        """Return the headline and all rows on one line."""
        cells = (" ".join(cell for cell in row if cell) for row in self.rows())
        return "  |  ".join([self.headline(leader), *cells])

    def _role(self, robot: int) -> str:
        return "gone" if robot in self.gone else self._state.roles.get(robot, "starting")

    def _error(self, robot: int) -> str:
        """Return D - k^d [m] from the last ground truth, as text; empty unless the robot follows."""
        heard, truth = self._state.tracking.get(robot), self._state.truth
        if heard is None or truth is None or self._role(robot) != "follower":
            return ""
        tracking, places = heard.message, {r.id: (r.x, r.y) for r in truth.robots}
        if robot not in places or tracking.predecessor not in places:
            return ""
        (x, y), (px, py) = places[robot], places[tracking.predecessor]
        return f"{hypot(x - px, y - py) - tracking.separation_m:+.3f} m"

    def _text(self, robot: int) -> str:
        """Return a follower's tracking state, or else the text of the robot's last status."""
        tracking, role = self._state.tracking.get(robot), self._role(robot)
        if role == "follower" and tracking is not None:
            return tracking.message.state
        status = self._state.status.get(robot_name(robot))
        note = "" if status is None else status.message.text
        return "" if role in ("gone", note) else note
