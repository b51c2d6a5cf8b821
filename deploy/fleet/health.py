"""Health of a fleet by its progress: every robot sends poses, all are in one chain. Pure: times are arguments."""

from __future__ import annotations

from math import inf

from lfa.deploy.client.fleet_state import FRESH_S, FleetState
from lfa.deploy.client.roster.roster_call import state_in
from lfa.protocol.incarnations import drawn_at, is_later
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.team import Event, PoseStamped
from lfa.protocol.names import robot_id_of, robot_name

TOLD_S = 2.0
"""Time [s] in which a leader tells who is in the team; until then a robot that has ended may have retired."""
GIVEN_UP = ("failed", "refused", "ended")


class Health:
    """Health monitor: `see` takes in messages, `missing` and `lost` return what is wrong."""

    def __init__(self, robots: tuple[int, ...], hosts: tuple[str, ...], *, starts: bool = False) -> None:
        """`robots` are those of the mission: the team, until a leader tells who has joined and who has retired.

        `starts`: no process of the fleet ran before, so that nobody has.
        """
        self._named = frozenset(map(robot_name, robots))
        self._robots = robots
        self.team_told = starts
        self._hosts = hosts
        self._state = FleetState()
        self._namesakes: dict[int, float] = {}
        """Time [s] of the last message from a process outside the fleet under that robot's name."""

    @property
    def texts(self) -> dict[str, str]:
        """Status text of each process, by name."""
        return {name: heard.message.text for name, heard in self._state.status.items()}

    def see(self, at: float, message: Message) -> None:
        """Update the state by a message that arrived at `at` [s]."""
        robot = robot_id_of(message.header.sender)
        if isinstance(message, PoseStamped) and robot and not self._own(robot, message.header.incarnation):
            self._namesakes[robot] = at
            return
        self._state.update(at, message)
        if isinstance(message, Event) and (told := state_in(message)) is not None and told.accepted:
            self._robots, self.team_told = told.team, True

    def lost(self, watched_s: float = inf) -> list[str]:
        """Return a line for each process that has ended and will not be restarted, with the cause.

        A robot that has retired may end: nothing is returned until it is known who has, or watched for TOLD_S.
        """
        if not self.team_told and watched_s <= TOLD_S:
            return []
        retired = self._named - set(map(robot_name, self._robots))
        return [
            f"host {host}: {report.ended or report.name}"
            for host, heard in sorted(self._state.hosts.items())
            for report in heard.message.processes
            if report.state in GIVEN_UP and report.name not in retired
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
        return self._state.chain(now)

    def _chain(self, now: float) -> list[str]:
        chain = self.chain(now)
        if not chain:
            texts = sorted({heard.message.text for heard in self._state.status.values() if heard.message.text})
            return [f"nobody leads{f' ({texts[0]})' if texts else ''}"]
        if len({self._state.poses[robot].message.term for robot in self._robots}) > 1:
            return ["not all are in one term"]
        return [
            f"{robot_name(robot)}: not in the chain{self._text(robot)}" for robot in self._robots if robot not in chain
        ]

    def _speaks(self, host: str, now: float) -> bool:
        return host in self._state.hosts and now - self._state.hosts[host].at < 3.0 * FRESH_S

    def _moves(self, robot: int, now: float) -> bool:
        spoken_for = now - self._namesakes.get(robot, -FRESH_S) < FRESH_S
        return not spoken_for and self._state.fresh(robot, now) is not None

    def _own(self, robot: int, incarnation: int) -> bool:
        """Return False if a message comes from another process than the one that the robot's supervisor started."""
        hosts = (heard.message for heard in self._state.hosts.values())
        reports = [report for host in hosts for report in host.processes if report.name == robot_name(robot)]
        return all(
            report.state == "running" and not is_later(drawn_at(report.began_ms, 0), incarnation) for report in reports
        )

    def _text(self, robot: int) -> str:
        if robot in self._namesakes:
            return " of its own: another process speaks in its name, end that one"
        heard = self._state.status.get(robot_name(robot))
        return f" ({heard.message.text})" if heard is not None and heard.message.text else ""
