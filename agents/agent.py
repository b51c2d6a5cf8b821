"""One agent, in two phases: it asks for its mission, and with the mission a `RobotCore` drives, votes and may lead."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec

from lfa.agents.robot_core import RobotCore
from lfa.agents.subscriptions import before_the_mission
from lfa.agents.telemetry import waiting_status
from lfa.protocol.errors import Refused
from lfa.protocol.incarnations import after
from lfa.protocol.lease.machine.lease import Lease, Observer
from lfa.protocol.messages.team import Ask, MissionNote
from lfa.protocol.mission import Mission
from lfa.protocol.names import robot_name
from lfa.protocol.node import Envelope, Received, Stop, Vitals
from lfa.protocol.outbox import Outbox

if TYPE_CHECKING:
    from lfa.agents.exploration.occupancy_grid import Grid

ASK_S = 0.5


class Agent:
    """Node of one incarnation of one robot. `floor` starts its terms (wall-clock milliseconds at boot)."""

    defer_hellos = True

    def __init__(
        self,
        robot_id: int,
        incarnation: int,
        fleet: str,
        floor: int,
        mission: Mission | None = None,
        *,
        spare: bool = False,
    ) -> None:
        """Create without a mission, or with the `mission` given; a `spare` is none of its robots (E33)."""
        self.lease_observer: Observer | None = None
        """Told of every event of the lease; set before the mission is known."""
        self._id = robot_id
        self._outbox = Outbox(fleet, robot_name(robot_id), incarnation)
        self._floor = floor
        self._given = mission
        self._spare = spare
        self._core: RobotCore | None = None
        self._next_ask = 0.0
        self._interests = before_the_mission(fleet)
        self._stopped = False
        self._refusal: str | None = None

    @property
    def name(self) -> str:
        return self._outbox.name

    @property
    def incarnation(self) -> int:
        return self._outbox.incarnation

    @property
    def started_with(self) -> dict[str, Any]:
        return {
            "kind": "agent",
            "robot_id": self._id,
            "mission": msgspec.to_builtins(self._given),
            "spare": self._spare,
        }

    @property
    def interests(self) -> frozenset[str]:
        return self._interests if self._core is None else self._core.interests

    @property
    def defer_grants(self) -> bool:
        """True while answers can wait for the next control step: the lease lasts well beyond it."""
        return self._core is not None and self._core.defer_grants

    @property
    def defer_rounds(self) -> bool:
        """True while the leader's rounds can wait for the next control step: this robot follows, and has no vote."""
        return self._core is not None and self._core.defer_rounds

    @property
    def lacks_messages(self) -> bool:
        """True while this robot does not hear all that its team sends, or has no mission (E27)."""
        return self._core is None or self._core.lacks_messages

    @property
    def refusal(self) -> str | None:
        """Reason, in one line, why this robot cannot take part with its mission; None if it can."""
        return self._refusal if self._core is None else self._core.refusal

    @property
    def core(self) -> RobotCore | None:
        """Robot of the mission; None before the mission."""
        return self._core

    @property
    def lease(self) -> Lease | None:
        """Lease of this robot, with the config that it knows; None before the mission."""
        return None if self._core is None else self._core.lease

    @property
    def grid(self) -> Grid | None:
        """Occupancy grid of an explorer, as far as mapped; None for other robots."""
        explore = None if self._core is None else self._core.navigator.leading.explore
        return None if explore is None or explore.mapping is None else explore.mapping.grid

    @property
    def finished(self) -> bool:
        return self._stopped if self._core is None else self._core.finished

    @property
    def may_end(self) -> bool:
        """False while this robot takes part, under its number, and was not asked to leave."""
        core = self._core
        if core is None:
            return self._stopped or self._refusal is not None
        return core.refusal is not None or core.leaves

    @property
    def waits_for(self) -> str | None:
        """What this robot waits for before it can take part: its mission, or robots of its team (E18)."""
        if self._core is None:
            return f"the mission, which lfa-world publishes in fleet {self._outbox.fleet}"
        return ", ".join(map(robot_name, self._core.lease.missing)) or None

    @property
    def reborn(self) -> Agent | None:
        """Return this robot's agent under a later number, once it is told of a later incarnation of its name (E23)."""
        newest = None if self._core is None else self._core.superseded_by
        if newest is None:
            return None
        number = after(newest, self.incarnation)
        return Agent(self._id, number, self._outbox.fleet, self._floor, self._given, spare=self._spare)

    def next_deadline(self) -> float:
        return self._next_ask if self._core is None else self._core.next_deadline()

    def tick(self, now: float) -> list[Envelope]:
        if self._core is not None:
            self._core.tick(now)
        elif self._given is not None:
            self._begin(self._given, now)
        elif now >= self._next_ask:
            self._next_ask = now + ASK_S
            self._outbox.publish("ask", Ask(self._outbox.header("ask", now), "mission"))
        return self._outbox.drain()

    def receive(self, received: Received) -> list[Envelope]:
        now, message = received.at, received.message
        if self._core is not None:
            self._core.receive(message, now)
            return self._outbox.drain()
        match message:
            case MissionNote():
                self._begin(message.whole, now)
            case Vitals():
                waiting_status(self._outbox, message, now)
            case Stop():
                self._stopped = True
        return self._outbox.drain()

    def _begin(self, mission: Mission, now: float) -> None:
        """Start with the mission: from here on this robot votes, follows and may lead."""
        try:
            self._core = RobotCore(
                self._id, mission, self._outbox, self._floor, now, self.lease_observer, spare=self._spare
            )
        except Refused as refused:
            self._refusal = str(refused)
