"""The Node between an agent and its robot's hardware: commands through the gateway, sensors out, fences answered.

It gives an agent the same interface as the simulated world does (`world/robot_hardware.py`). It subscribes to
`cmd_vel` of its own robot, FENCE to its gateway, and its agent's liveliness; it publishes `sensors` (with the gateway's
own stamp, which commands must echo), `localization`, `scan` and `contact`. The gateway's deadman brakes when the agent,
the router or the network is gone: it runs here, on this machine's clock, and depends on no other process.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from math import inf
from typing import Any

from lfa.deploy.robot.base import Base, Reading
from lfa.protocol.fleet_stop.answers import StopAnswers
from lfa.protocol.geometry import STILL
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.timing import timing_for
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Fence, LeaseNote, Term
from lfa.protocol.messages.robot import CmdVel, Contact, LaserScan, Localization, SensorReading
from lfa.protocol.messages.stop import StopOrder
from lfa.protocol.messages.team import Ask, MissionNote
from lfa.protocol.mission import Limits
from lfa.protocol.names import robot_name
from lfa.protocol.node import Envelope, PeerDown, PeerUp, Received, RouterLost, Stop
from lfa.protocol.outbox import Outbox
from lfa.protocol.topics import DRIVER_PREFIX, TO_ALL, TOPIC, alive_key, key

PERIOD_S = 1.0 / (TOPIC["sensors"].rate_hz or 50.0)
ASK_S = 1.0
REFUSAL_EVERY_S = 0.2


MakeBase = Callable[[Limits, float], Base]
"""Function that opens a robot's hardware: its mission's limits and the time [s] in, the hardware out."""


def heard_by_driver(fleet: str, robot_id: int) -> frozenset[str]:
    """Return the key expressions that the driver of robot `robot_id` subscribes to."""
    own = robot_name(robot_id)
    others = {key(fleet, "*", "mission"), key(fleet, "*", "stop"), key(fleet, "*", "lease", f"gateway{robot_id}")}
    return frozenset(others | {key(fleet, own, "cmd_vel"), alive_key(fleet, own, "*")})


class Driver:
    """Driver of robot `robot_id`; `make_base(limits, now)` opens its hardware once the mission is known."""

    def __init__(
        self,
        fleet: str,
        robot_id: int,
        incarnation: int,
        make_base: MakeBase,
        alive: Callable[[float], None] = lambda now: None,
        *,
        spare: bool = False,
    ) -> None:
        """Create a driver; `alive(now)` is called after each control period in which the hardware answered.

        A `spare` is none of the mission's robots (E33).
        """
        self.name = f"{DRIVER_PREFIX}{robot_id}"
        self.incarnation = incarnation
        self.finished = False
        self.refusal: str | None = None
        self.defer_hellos = self.defer_grants = False
        self.started_with: dict[str, Any] = {"kind": "driver", "robot_id": robot_id}
        self.interests = heard_by_driver(fleet, robot_id)
        self._robot_id = robot_id
        self._spare = spare
        self._make_base = make_base
        self._alive = alive
        self._base: Base | None = None
        self._gateway: Gateway | None = None
        self._cut_off = False
        self._next = -inf
        self._outbox = Outbox(fleet, self.name, incarnation, first=1)
        self._hardware = Outbox(fleet, self.name, incarnation, robot_name(robot_id), first=1)
        self._gateway_outbox = Outbox(fleet, robot_name(robot_id), incarnation, first=1)
        self._answers = StopAnswers(self._hardware)
        self._twist = STILL
        """Twist last measured."""
        self._led: Term | None = None
        self._refused_at: dict[str, float] = {}

    def next_deadline(self) -> float:
        return inf if self.finished else self._next

    def receive(self, received: Received) -> list[Envelope]:
        """Process a message: commands and fences take effect at once."""
        now, gateway = received.at, self._gateway
        match received.message:
            case MissionNote(mission=mission) if gateway is None:
                if self._robot_id not in mission.robots and not self._spare:
                    self.refusal = f"id {self._robot_id}: not in the mission, which has robots {list(mission.robots)}"
                    return []
                self._gateway = Gateway(
                    self._robot_id,
                    self.incarnation,
                    timing_for(mission),
                    now,
                    mission.limits,
                    mission.operator_timeout_s,
                )
                self._base = self._make_base(mission.limits, now)
                self._next = now
            case CmdVel() as cmd if gateway is not None:
                return self._command(cmd, gateway, now)
            case LeaseNote(body=Fence() as fence) if gateway is not None:
                note = LeaseNote(self._gateway_outbox.header("lease", now), gateway.fence(fence, now))
                return [self._gateway_outbox.envelope("lease", note, TO_ALL)]
            case StopOrder() as order if gateway is not None:
                gateway.stop.order(order, now)
                return [self._answers.answer(gateway.stop, self._twist, now)]
            case PeerUp(incarnation=incarnation) if gateway is not None:
                self._cut_off = False
                gateway.agent_up(incarnation, now)
            case PeerDown(incarnation=incarnation) if gateway is not None and not self._cut_off:
                gateway.agent_down(incarnation, now)
            case RouterLost():
                self._cut_off = True
            case Stop():
                self.finished = True
                self.brake(now)
        return []

    def tick(self, now: float) -> list[Envelope]:
        """Drive the twist that the gateway lets through, and return the hardware's measurements as messages.

        An error of the hardware, or of its watchdog, ends the driver; its last command to the motors is a stop.
        """
        if self.finished:
            return []
        if self._gateway is None or self._base is None:
            self._next = now + ASK_S
            return [self._outbox.envelope("ask", Ask(self._outbox.header("ask", now), "mission"))]
        self._next = max(self._next + PERIOD_S, now)
        try:
            self._base.drive(self._gateway.twist(now), now)
            reading = self._base.read(now)
            if reading is None:  # its agent then knows no fresh stamp of this gateway, and the deadman brakes
                return []
            self._alive(now)
        except Exception:
            self.brake(now)
            raise
        return self._said(reading, self._gateway, now)

    def brake(self, now: float) -> None:
        """Command a stop, whatever else has failed: the last act on every way out of the process."""
        if self._base is not None:
            with suppress(Exception):  # broken hardware may refuse the stop as well; the watchdog is left then
                self._base.drive(STILL, now)

    def _said(self, reading: Reading, gateway: Gateway, now: float) -> list[Envelope]:
        self._twist = reading.twist
        header = self._hardware.header("sensors", now)
        sent: list[Message] = [
            gateway.sensors(header, reading.pose_odom, reading.twist, reading.odometer_m, now),
        ]
        topics = ["sensors"]
        if reading.pose_map is not None:
            header = self._hardware.header("localization", now)
            sent.append(Localization(header, reading.pose_map, reading.sigma_m, reading.sigma_rad))
            topics.append("localization")
        if (scan := reading.scan) is not None:
            turn = (scan.angle_min, scan.angle_increment, scan.range_min_m, scan.range_max_m, scan.ranges_m)
            sent.append(LaserScan(self._hardware.header("scan", now), *turn))
            topics.append("scan")
        if reading.contact is not None:
            sent.append(Contact(self._hardware.header("contact", now), reading.contact))
            topics.append("contact")
        for name, values in reading.own.items():
            sent.append(SensorReading(self._hardware.header("reading", now), name, values))
            topics.append("reading")
        said = [self._hardware.envelope(topic, message) for topic, message in zip(topics, sent, strict=True)]
        rests = self._answers.at_rest(gateway.stop, self._twist, now)
        return said if rests is None else [*said, rests]

    def _command(self, cmd: CmdVel, gateway: Gateway, now: float) -> list[Envelope]:
        """Pass `cmd` to the gateway; return an event for each new term led and, rate-limited, for refusals."""
        reason = gateway.command(cmd, now)
        if reason is None:
            if not cmd.as_leader or cmd.term == self._led:
                return []
            self._led = cmd.term
            return [self._event("leader_command", cmd.term, {}, now)]
        if now - self._refused_at.get(reason, -inf) < REFUSAL_EVERY_S:
            return []
        self._refused_at[reason] = now
        return [self._event("refused", cmd.term, {"reason": reason, "count": gateway.refused[reason]}, now)]

    def _event(self, kind: str, term: Term, data: dict[str, Any], now: float) -> Envelope:
        return self._outbox.event_envelope(kind, now, term, {"robot": self._robot_id, **data})
