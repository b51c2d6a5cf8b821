"""Inward half of the bridge: orders of ROS users, each parsed, checked and passed on as an operator's message."""

from __future__ import annotations

from collections.abc import Callable
from math import degrees
from typing import Any, Protocol

from lfa.agents.formation.formation import named
from lfa.deploy.ros.bridge.answers import answer
from lfa.deploy.ros.bridge.stop_calls import RESUME, STOP
from lfa.deploy.ros.quaternions import yaw_of
from lfa.deploy.ros.session import NodeHandle, ServiceCall
from lfa.protocol.errors import Refused
from lfa.protocol.mission import FormationSpec

GOAL = "/goal_pose"
"""Topic of RViz's button `2D Goal Pose`."""
PAUSE = "/lfa/pause"
HANDOVER = "/lfa/handover"
HANDOVER_S_MAX = 5.0
"""Time [s] within which another robot must lead after a hand-over was asked for."""
WORDS_MAX = 120
"""Number of characters of a line that repeats a foreign text."""
TRIGGER, SET_BOOL = "std_srvs/srv/Trigger", "std_srvs/srv/SetBool"
SERVICES = {RESUME: TRIGGER, STOP: TRIGGER, PAUSE: SET_BOOL, HANDOVER: TRIGGER}
"""Type of each service, in the order in which calls that wait together are obeyed: stop after resume."""


class FleetCommands(Protocol):
    """What the bridge can tell its fleet; a service call is answered by what became of it."""

    def order(self, name: str, **arguments: object) -> None:
        """Send an operator's command."""

    def stop(self, call: ServiceCall, now: float, *, stand: bool) -> None:
        """Stop every robot at its gateway, or let it go."""

    def pause(self, call: ServiceCall, now: float, *, paused: bool) -> None:
        """Let the leader stand, or drive on."""

    def go(self, x: float, y: float, theta_deg: float, now: float) -> None:
        """Send the team to a goal in `map` [m, degrees]; warns if that is not carried out. Raises Refused."""

    def warn(self, words: str) -> None:
        """Print a warning, and publish it on /rosout."""


class HandoverCalls:
    """Calls of the hand-over service that wait for another leader."""

    def __init__(self, order: Callable[..., None]) -> None:
        """`order`: see FleetCommands."""
        self._order = order
        self._waiting: list[tuple[float, int, ServiceCall]] = []
        """Deadline [s], the leader at the call, and the call."""

    def ask(self, call: ServiceCall, leader: int, now: float) -> None:
        """Order a hand-over; `leader`: 0 for none."""
        if not leader:
            answer(call, success=False, text="nobody leads at the moment")
            return
        self._order("handover")
        self._waiting.append((now + HANDOVER_S_MAX, leader, call))

    def step(self, leader: int, now: float) -> None:
        """Answer the calls that are decided."""
        undecided = []
        for deadline, before, call in self._waiting:
            if leader not in (0, before):
                answer(call, success=True, text=f"robot {leader} leads")
            elif now > deadline:
                answer(call, success=False, text=f"robot {before} still leads after {HANDOVER_S_MAX:g} s")
            else:
                undecided.append((deadline, before, call))
        self._waiting = undecided


class ServiceInput:
    """Calls of the services, from ROS or from Foxglove."""

    def __init__(self, fleet: FleetCommands) -> None:
        self._fleet = fleet
        self._handovers = HandoverCalls(fleet.order)

    def obey(self, service: str, call: ServiceCall, leader: int, now: float) -> None:
        """Obey a call of one of SERVICES; `leader`: 0 for none."""
        if service in (STOP, RESUME):
            self._fleet.stop(call, now, stand=service == STOP)
        elif service == PAUSE:
            self._fleet.pause(call, now, paused=bool(call.request.data))
        else:
            self._handovers.ask(call, leader, now)

    def step(self, leader: int, now: float) -> None:
        """Answer the hand-overs that are decided."""
        self._handovers.step(leader, now)


class OperatorInput:
    """Topics `/lfa/formation/set` (String) and `/goal_pose` (PoseStamped), and the services, of a ROS node."""

    def __init__(self, node: NodeHandle, fleet: FleetCommands) -> None:
        self._fleet = fleet
        self._formation = node.subscription("/lfa/formation/set", "std_msgs/msg/String")
        self._goals = node.subscription(GOAL, "geometry_msgs/msg/PoseStamped")
        self._services = {name: node.service(name, of_type) for name, of_type in SERVICES.items()}
        self._input = ServiceInput(fleet)

    def step(self, leader: int, now: float) -> None:
        """Obey what came in; answer the calls that are decided. `leader`: 0 for none."""
        for name, service in self._services.items():
            for call in service.take():
                self._input.obey(name, call, leader, now)
        for message in self._formation.take():
            self._change_formation(message.data)
        for message in self._goals.take()[-1:]:
            self._go(message, now)
        self._input.step(leader, now)

    def _change_formation(self, side: str) -> None:
        try:
            named(side, FormationSpec())
        except Refused as refused:
            self._fleet.warn(f"/lfa/formation/set: {refused}"[:WORDS_MAX])
            return
        self._fleet.order("formation", side=side)

    def _go(self, message: Any, now: float) -> None:
        """Pass a goal on; one in another frame than `map`, or of numbers that are none, is warned of."""
        frame, place, yaw = message.header.frame_id, message.pose.position, yaw_of(message.pose.orientation)
        try:
            if frame.lstrip("/") != "map":
                raise Refused(f"frame {frame!r}: must be 'map', RViz's fixed frame"[:WORDS_MAX])
            if yaw is None:
                raise Refused("orientation: must be a quaternion of length 1")
            self._fleet.go(place.x, place.y, degrees(yaw), now)
        except Refused as refused:
            self._fleet.warn(f"{GOAL}: {refused}")
