"""State of a running fleet from its messages, the one source of every view of it. Pure: times come with the messages.

Its readers: progress of a run (`deploy/run/progress_rows.py`), `lfa watch` and `lfa top` (`team_status.py`), health
and hosts of a fleet on several machines (`deploy/fleet`), benches and tests of teams (`deploy/bench/harness`).
"""

from __future__ import annotations

from typing import Any, Generic, NamedTuple, TypeVar

from msgspec import structs

from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.fleet import HostStatus
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.team import REFUSED_OF, Event, PoseStamped, Status, Tracking
from lfa.protocol.names import robot_id_of, robot_name
from lfa.protocol.topics import HOST_PREFIX

M = TypeVar("M")
COUNT_MAX = 2.0**53
"""Greatest counter that is believed: any number may stand there."""
FRESH_S = 1.0
"""Age [s] from which a pose is outdated: its robot counts as silent."""
STATUS_S = 2.5
"""Age [s] up to which a status counts, which comes once a second."""


class Heard(NamedTuple, Generic[M]):
    """A message with its time [s] on the observer's clock."""

    at: float
    message: M


class AdoptedChain(NamedTuple):
    """Chain that a robot has adopted, with the version of its config."""

    version: tuple[int, ...]
    """Number, issuer and incarnation of its term, and its sequence number in the term."""
    chain: tuple[int, ...]


class FleetState:
    """Newest message of each kind from each robot and host, updated by `update`."""

    def __init__(self) -> None:
        self.poses: dict[int, Heard[PoseStamped]] = {}
        self.tracking: dict[int, Heard[Tracking]] = {}
        self.status: dict[str, Heard[Status]] = {}
        """By name: the witness has one, too."""
        self.hosts: dict[str, Heard[HostStatus]] = {}
        self.chains: dict[int, AdoptedChain] = {}
        self.roles: dict[int, str] = {}
        """Role of each robot by its last status or change of role."""
        self.term = 0
        """Highest term number in a status or a change of role."""
        self.truth: Truth | None = None

    def update(self, at: float, message: Message) -> None:
        """Update the state by a message of time `at` [s]."""
        robot = robot_id_of(message.header.sender)
        match message:
            case PoseStamped() if robot:
                self.poses[robot] = Heard(at, message)
            case Tracking() if robot:
                self.tracking[robot] = Heard(at, message)
            case Truth():
                self.truth = message
            case HostStatus() if message.header.sender == f"{HOST_PREFIX}{message.host}":
                self.hosts[message.host] = Heard(at, message)
            case Status():
                self.status[message.header.sender] = Heard(at, message)
                if robot:
                    self._role(robot, message.role, message.term.n)
                    self._catch_up(robot, message.counters)
            case Event() if robot:
                self._event(robot, message)

    def refused(self) -> dict[str, int]:
        """Return how many messages and tokens all robots together refused of a member for its rates, by its name."""
        found: dict[str, int] = {}
        for heard in self.status.values():
            for name, number in heard.message.counters.items():
                if name.startswith(REFUSED_OF) and 0.0 < number <= COUNT_MAX:  # False for nan
                    member = name.removeprefix(REFUSED_OF)
                    found[member] = found.get(member, 0) + int(number)
        return found

    def forget(self, robot: int) -> None:
        """Forget what an ended incarnation of a robot said."""
        for known in (self.poses, self.tracking, self.chains, self.roles):
            known.pop(robot, None)

    def fresh(self, robot: int, now: float, within_s: float = FRESH_S) -> PoseStamped | None:
        """Return a robot's pose if it is younger than `within_s` [s]."""
        heard = self.poses.get(robot)
        return heard.message if heard is not None and now - heard.at < within_s else None

    def leaders(self, now: float, within_s: float = FRESH_S) -> list[int]:
        """Return the robots whose recent pose claims leadership, that of the highest term last."""
        recent = {robot: self.fresh(robot, now, within_s) for robot in self.poses}
        claims = [(pose.term, robot) for robot, pose in recent.items() if pose and pose.role is Role.LEADER]
        return [robot for _, robot in sorted(claims)]

    def leader(self, now: float) -> int | None:
        """Return the leader by the robots' poses: the one of the highest term; None if none claims to lead."""
        return next(reversed(self.leaders(now)), None)

    def chain(self, now: float) -> tuple[int, ...]:
        """Return the chain from the leader on, as far as each robot follows a member of it."""
        leader = self.leader(now)
        if leader is None:
            return ()
        links = {self._predecessor(robot, now): robot for robot in self.poses if self._follows(robot)}
        chain = [leader]
        while (following := links.get(chain[-1])) is not None and following not in chain:
            chain.append(following)
        return tuple(chain)

    def _follows(self, robot: int) -> bool:
        return self.poses[robot].message.role is Role.FOLLOWER

    def _predecessor(self, robot: int, now: float) -> int | None:
        """Return the robot that a follower tracks, or has in front of it in the chain of its status: a robot that was
        stopped before its first step behind a new predecessor has not tracked it yet.
        """
        tracking = self.tracking.get(robot)
        if tracking is not None and now - tracking.at < FRESH_S:
            return tracking.message.predecessor
        status = self.status.get(robot_name(robot))
        chain = () if status is None or now - status.at > STATUS_S else status.message.chain
        return chain[chain.index(robot) - 1] if robot in chain[1:] else None

    def _role(self, robot: int, role: str, term: int) -> None:
        self.roles[robot] = role
        self.term = max(self.term, term)

    def _event(self, robot: int, event: Event) -> None:
        match event:
            case Event(kind="role", data={"role": str() as role}):
                self._role(robot, role, 0 if event.term is None else event.term.n)
            case Event(kind="chain", data={"chain": chain, "seq": int() as seq}) if event.term is not None:
                self.chains[robot] = AdoptedChain((*structs.astuple(event.term), seq), _ids(chain))

    def _catch_up(self, robot: int, counters: dict[str, Any]) -> None:
        """Update a robot's chain from the config version in its status, in case its chain event was lost.

        The chain is that of a robot that reported the same version.
        """
        known = max(self.chains.values(), default=None)
        said = (counters.get("config_n"), counters.get("config_seq"))
        if known is not None and said == (known.version[0], known.version[-1]):
            self.chains[robot] = known


def _ids(chain: object) -> tuple[int, ...]:
    """Return the robot ids in an event's data, which any sender may have written."""
    return tuple(robot for robot in chain if isinstance(robot, int)) if isinstance(chain, list | tuple) else ()
