"""Test rig of the world as a Node: it calls the deadlines, sends commands, and keeps the published messages."""

from __future__ import annotations

from typing import Any

import msgspec

from lfa.protocol.geometry import Twist
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import GatewayStamp, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.stop import NEVER_STOPPED
from lfa.protocol.messages.team import Event
from lfa.protocol.node import Envelope, Received
from lfa.world.description.load import draw, load
from lfa.world.world import World

FLEET = "test"
T0 = 1000.0
TERM = Term(5, 1, 1)
STD = timing_of("std")
NOISE = "world.noise={localization_m=0.005, localization_rad=0.01, odometry=0.01, range_m=0.01}"
CHECKED_S = 1.0


class Rig:
    """World with manual inputs: it ticks when due, and keeps the published messages."""

    def __init__(self, *overrides: str, scenario: str = "straight", seed: int = 1, **options: Any) -> None:
        self.world = World(FLEET, draw(load(scenario, overrides), seed), seed, incarnation=9, start_at=T0, **options)
        self.now = T0
        self.said: list[Envelope] = []
        self._seq = 0

    def run(self, duration_s: float, twist: Twist | None = None, leader: int = 1) -> list[Envelope]:
        """Tick for `duration_s`, commanding `twist` to every robot at 50 Hz if given; return the published messages."""
        before = len(self.said)
        end = self.now + duration_s
        while self.world.next_deadline() <= end + 1e-9:
            self.now = self.world.next_deadline()
            self.said += self.world.tick(self.now)
            if twist is not None:
                for robot_id in self.world._scenario.mission.robots:
                    self.command(robot_id, twist, as_leader=robot_id == leader)
        return self.said[before:]

    def command(
        self, robot_id: int, twist: Twist, as_leader: bool = False, term: Term = TERM, **changes: Any
    ) -> list[Envelope]:
        self._seq += 1
        cmd = CmdVel(
            header=Header(f"robot{robot_id}", 1, self._seq, self.now),
            twist=twist,
            term=term,
            holder=1,
            as_leader=as_leader,
            gateway=GatewayStamp(9, self.now),
            stop=NEVER_STOPPED,
            grant_s=timing_of("std").grant_s,
        )
        return self.hear(f"robot{robot_id}/cmd_vel", msgspec.structs.replace(cmd, **changes))

    def hear(self, where: str, message: Any) -> list[Envelope]:
        sent = self.world.receive(Received(self.now, f"lfa/{FLEET}/{where}" if where else "", message))
        self.said += sent
        return sent

    def opened(self) -> Rig:
        """Run until the new gateways accept commands (E13)."""
        self.run(STD.grant_s + 0.02)
        return self

    def truth(self) -> Truth:
        truth: Truth = last(self.said, Truth)
        return truth


def of(said: list[Envelope], kind: type, owner: str | None = None) -> list[Any]:
    return [e.message for e in said if isinstance(e.message, kind) and owner in (None, e.key.split("/")[2])]


def last(said: list[Envelope], kind: type, owner: str | None = None) -> Any:
    return of(said, kind, owner)[-1]


def events(said: list[Envelope], kind: str) -> list[Event]:
    return [event for event in of(said, Event) if event.kind == kind]


FAR_BUMP = "world.bumps=[{center_m=[50,50], width_m=0.1, length_m=1, height_m=0.01}]"
MOVER = "world.obstacles=[{center_m=[3,1], radius_m=0.3, waypoints_m=[[3,-1]], speed_mps=0.4}]"
