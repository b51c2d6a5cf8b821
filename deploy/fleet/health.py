"""Health of a fleet by its progress: every robot sends poses, all are in one chain. Pure: times are arguments."""

from __future__ import annotations

from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.fleet import HostStatus
from lfa.protocol.messages.team import PoseStamped, Status, Tracking
from lfa.protocol.names import robot_id_of, robot_name

FRESH_S = 1.0
GIVEN_UP = ("failed", "refused", "ended")


class Health:
    """Health monitor: `see` takes in messages, `missing` and `lost` return what is wrong."""

    def __init__(self, robots: tuple[int, ...], hosts: tuple[str, ...]) -> None:
        self._robots = robots
        self._hosts = hosts
        self._poses: dict[int, tuple[float, PoseStamped]] = {}
        self._ahead: dict[int, tuple[float, int]] = {}
        self._texts: dict[int, str] = {}
        self._status: dict[str, tuple[float, HostStatus]] = {}
        self._namesakes: dict[int, float] = {}
        """Time [s] of the last message from a process outside the fleet under that robot's name."""

    def see(self, at: float, message: Message) -> None:
        """Update the state by a message that arrived at `at` [s]."""
        robot = robot_id_of(message.header.sender)
        match message:
            case HostStatus():
                self._status[message.host] = (at, message)
            case PoseStamped() if robot is not None:
                if self._own(robot, message.header.incarnation):
                    self._poses[robot] = (at, message)
                else:
                    self._namesakes[robot] = at
            case Tracking() if robot is not None:
                self._ahead[robot] = (at, message.predecessor)
            case Status() if robot is not None:
                self._texts[robot] = message.text

    def lost(self) -> list[str]:
        """Return a line for each process that has ended and will not be restarted, with the cause."""
        return [
            f"host {host}: {report.ended or report.name}"
            for host, (_, status) in sorted(self._status.items())
            for report in status.processes
            if report.state in GIVEN_UP
        ]

    def missing(self, now: float) -> list[str]:
        """Return a line for each deficiency.

        Empty: every robot sends poses, one of them leads, and the others follow each other in one chain.
        """
        silent = [f"host {name}: nothing is heard of it" for name in self._hosts if not self._speaks(name, now)]
        unheard = [
            f"{robot_name(robot)}: no pose{self._text(robot)}" for robot in self._robots if not self._moves(robot, now)
        ]
        if silent or unheard:
            return silent + unheard
        return self._chain(now)

    def chain(self, now: float) -> tuple[int, ...]:
        """Return the chain from the leader on, as far as each robot follows a member of it."""
        leaders = [
            (pose.term, robot) for robot, (at, pose) in self._poses.items() if self._leads(pose) and now - at < FRESH_S
        ]
        if not leaders:
            return ()
        links = {
            ahead: robot for robot, (at, ahead) in self._ahead.items() if now - at < FRESH_S and self._follows(robot)
        }
        chain = [max(leaders)[1]]
        while (following := links.get(chain[-1])) is not None and following not in chain:
            chain.append(following)
        return tuple(chain)

    def _chain(self, now: float) -> list[str]:
        chain = self.chain(now)
        if not chain:
            texts = sorted({text for text in self._texts.values() if text})
            return [f"nobody leads{f' ({texts[0]})' if texts else ''}"]
        if len({self._poses[robot][1].term for robot in self._robots}) > 1:
            return ["not all are in one term"]
        return [
            f"{robot_name(robot)}: not in the chain{self._text(robot)}" for robot in self._robots if robot not in chain
        ]

    def _speaks(self, host: str, now: float) -> bool:
        return host in self._status and now - self._status[host][0] < 3.0 * FRESH_S

    def _moves(self, robot: int, now: float) -> bool:
        spoken_for = now - self._namesakes.get(robot, -FRESH_S) < FRESH_S
        return not spoken_for and robot in self._poses and now - self._poses[robot][0] < FRESH_S

    def _own(self, robot: int, incarnation: int) -> bool:
        """Return False if a message comes from another process than the one that the robot's supervisor started."""
        reports = [r for _, status in self._status.values() for r in status.processes if r.name == robot_name(robot)]
        return all(report.state == "running" and incarnation >= report.began_ms for report in reports)

    def _follows(self, robot: int) -> bool:
        return robot in self._poses and self._poses[robot][1].role is Role.FOLLOWER

    @staticmethod
    def _leads(pose: PoseStamped) -> bool:
        return pose.role is Role.LEADER

    def _text(self, robot: int) -> str:
        if robot in self._namesakes:
            return " of its own: another process speaks in its name, end that one"
        text = self._texts.get(robot, "")
        return f" ({text})" if text else ""
