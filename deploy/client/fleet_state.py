"""State of a running fleet from its messages: for progress on a terminal, and to know which robot leads."""

from __future__ import annotations

from math import hypot

from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.team import Event, Status, Tracking
from lfa.protocol.names import robot_id_of


class FleetState:
    """State of each robot, updated from messages by `see`, as text in `rows` and `line`. Times are world time [s]."""

    def __init__(self, robots: tuple[int, ...]) -> None:
        self._robots = robots
        self._roles: dict[int, str] = {}
        self._term = 0
        self._tracking: dict[int, Tracking] = {}
        self._notes: dict[int, str] = {}
        self._truth: Truth | None = None
        self.gone: set[int] = set()

    def see(self, message: Message) -> None:
        """Update the state from one message."""
        robot = robot_id_of(message.header.sender)
        match message:
            case Truth():
                self._truth = message
            case Tracking() if robot is not None:
                self._tracking[robot] = message
            case Status() if robot is not None:
                self._notes[robot] = message.text
                self._roles[robot] = message.role
                self._term = max(self._term, message.term.n)
            case Event(kind="role", data={"role": str() as role}) if robot is not None:
                self._roles[robot] = role
                if message.term is not None:
                    self._term = max(self._term, message.term.n)

    @property
    def time_s(self) -> float:
        return 0.0 if self._truth is None else self._truth.time_s

    def headline(self, leader: int | None) -> str:
        who = "no leader yet" if leader is None else f"leader {leader}, term {self._term}"
        return f"{self.time_s:7.1f} s  {who}"

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Return name, role, distance error and state of each robot."""
        return [(f"robot{robot}", self._role(robot), self._error(robot), self._state(robot)) for robot in self._robots]

    def line(self, leader: int | None) -> str:
        """Return the headline and all rows on one line."""
        cells = (" ".join(cell for cell in row if cell) for row in self.rows())
        return "  |  ".join([self.headline(leader), *cells])

    def _role(self, robot: int) -> str:
        return "gone" if robot in self.gone else self._roles.get(robot, "starting")

    def _error(self, robot: int) -> str:
        """Return D - k^d [m] from the last ground truth, as text; empty unless the robot follows."""
        tracking, truth = self._tracking.get(robot), self._truth
        if tracking is None or truth is None or self._role(robot) != "follower":
            return ""
        places = {r.id: (r.x, r.y) for r in truth.robots}
        if robot not in places or tracking.predecessor not in places:
            return ""
        (x, y), (px, py) = places[robot], places[tracking.predecessor]
        return f"{hypot(x - px, y - py) - tracking.separation_m:+.3f} m"

    def _state(self, robot: int) -> str:
        """Return a follower's tracking state, or else the text of the robot's last status."""
        tracking, role = self._tracking.get(robot), self._role(robot)
        if role == "follower" and tracking is not None:
            return tracking.state
        note = self._notes.get(robot, "")
        return "" if role in ("gone", note) else note
