"""What a team of real processes on this machine has said: its state, and its events and tracking in their order.

All processes of one machine read one clock (`lfa.protocol.clock`), and every header carries a stamp of the sender's
clock. So only here may stamps of different processes be subtracted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from lfa.deploy.client.fleet_state import FleetState
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.team import Event, Tracking
from lfa.protocol.names import robot_name

SPEAKING_S = 0.15
"""Time [s] without a pose after which a robot counts as absent."""
REST_MPS = 1e-3
"""Maximum speed [m/s] of a robot at rest."""
EVENTS_MAX = 4096


class TeamHistory:
    """Messages of a team of `robots`; times are the senders' stamps [s]."""

    def __init__(self, robots: tuple[int, ...]) -> None:
        self._robots = robots
        self.state = FleetState()
        self.events: list[Event] = []
        self.tracking: list[Tracking] = []
        self.speeds_mps: dict[int, float] = {}
        """True speed [m/s] of each robot in the world's last message."""
        self.moved_at: dict[int, float] = {}
        """Time [s] of the last motion of each robot, by the world's stamp."""

    def take(self, messages: Iterable[Message]) -> None:
        """Take in messages in their order."""
        for message in messages:
            self.state.update(message.header.stamp, message)
            match message:
                case Truth():
                    self.speeds_mps = {robot.id: abs(robot.linear_x) for robot in message.robots}
                    moving = (robot for robot, speed_mps in self.speeds_mps.items() if speed_mps > REST_MPS)
                    self.moved_at |= dict.fromkeys(moving, message.header.stamp)
                case Tracking():
                    self.tracking.append(message)
                case Event():
                    self.events.append(message)
        del self.events[:-EVENTS_MAX], self.tracking[:-EVENTS_MAX]

    def chain(self, now: float) -> tuple[int, ...]:
        """Return the chain on which all present robots agree; empty if they disagree or a member is absent."""
        speaking = [robot for robot in self._robots if self.state.fresh(robot, now, SPEAKING_S) is not None]
        adopted = {self.state.chains.get(robot) for robot in speaking}
        if len(adopted) != 1 or (agreed := adopted.pop()) is None:
            return ()
        whole = set(agreed.chain) <= set(speaking)
        return agreed.chain if whole and self.state.leaders(now, SPEAKING_S) == [agreed.chain[0]] else ()

    def describe(self, now: float) -> str:
        """Return the roles and chains of the robots as text, for error messages."""
        poses = {robot: self.state.fresh(robot, now, SPEAKING_S) for robot in sorted(self.state.poses)}
        roles = {robot: str(pose.role) for robot, pose in poses.items() if pose is not None}
        chains = {robot: adopted.chain for robot, adopted in sorted(self.state.chains.items())}
        return f"roles {roles}, chains {chains}"

    def first(self, kind: str, since: float, fits: Callable[[Event], bool]) -> float | None:
        """Return the stamp [s] of the first `kind` event since `since` that `fits`, by its sender's clock, or None."""
        stamps = [e.header.stamp for e in self.events if e.kind == kind and e.header.stamp >= since and fits(e)]
        return min(stamps, default=None)

    def adopted(self, since: float, robots: Sequence[int], fits: Callable[[Sequence[int]], bool]) -> float | None:
        """Return the time [s] when the last of `robots` adopted a chain that `fits`; None until all have."""
        first: dict[str, float] = {}
        for event in self.events:
            if event.kind == "chain" and event.header.stamp >= since and fits(event.data["chain"]):
                first.setdefault(event.header.sender, event.header.stamp)
        at = [first.get(robot_name(robot), float("inf")) for robot in robots]
        return max(at) if at and max(at) < float("inf") else None
