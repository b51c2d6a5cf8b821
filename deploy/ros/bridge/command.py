"""`lfa ros`: a running fleet as ROS 2 topics, until Ctrl-C or SIGTERM.

Two sessions, never one network: an observer of the fleet, and a client of the ROS router or that router itself.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import typer

from lfa.deploy.client.operator import Operator
from lfa.deploy.client.session import Subscriber, find, listen
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.ros import messages
from lfa.deploy.ros.bridge.inward import OperatorInput
from lfa.deploy.ros.bridge.outward import BRIDGE_NODE, RosOutput
from lfa.deploy.ros.bridge.sender_clocks import SenderClocks
from lfa.deploy.ros.mapping import FleetMapping, RosMessage
from lfa.deploy.ros.session import GraphFeed, RosSpace
from lfa.deploy.ros.topics import SOURCES
from lfa.deploy.ros.types import typestore
from lfa.deploy.ros.wire import Distro, check_domain
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.names import robot_id_of
from lfa.protocol.transport.bus import Wake
from lfa.protocol.transport.message_bus import send
from lfa.protocol.transport.zenoh_ros import ros_session

ROUTER = "tcp/127.0.0.1:7447"
SERVED = "tcp/[::]:7447"
PERIOD_S = 0.02
GRAPH_S = 1.0
"""Time [s] to wait for the tokens of those who are there already."""
EAGER = frozenset({"sensors", "scan"})
"""Topics that are passed on at once; all others within a period."""


def command(
    fleet: Annotated[str | None, typer.Option(help="Name of the fleet, when several run here.")] = None,
    connect: Annotated[str | None, typer.Option(help="Router of the fleet; default the fleet's own here.")] = None,
    keys: Annotated[Path | None, typer.Option(help="Folder of lfa keys, for a secured fleet.")] = None,
    ros: Annotated[str | None, typer.Option(help=f"ROS router; default {ROUTER}, with --serve {SERVED}.")] = None,
    serve: Annotated[bool, typer.Option("--serve", help="Be the ROS router: no rmw_zenohd is needed.")] = False,
    domain: Annotated[int, typer.Option(help="ROS_DOMAIN_ID.")] = 0,
    distro: Annotated[
        Literal["humble", "jazzy", "kilted", "lyrical", "rolling"],
        typer.Option(help="Distribution of the ROS nodes: humble has keys of its own, all others are alike."),
    ] = "jazzy",
    sim_time: Annotated[
        bool, typer.Option("--sim-time", help="Stamps in the world's time, and /clock (use_sim_time of ROS nodes).")
    ] = False,
    tf_per_robot: Annotated[
        bool, typer.Option("--tf-per-robot", help="Topics /robotN/tf with plain frames, not /tf with robotN/ frames.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the counters at the end as JSON.")] = False,
) -> int:
    """Bridge a running fleet to ROS 2."""
    check_domain(domain)
    found = find(fleet, connect, keys)
    endpoint = ros or (SERVED if serve else ROUTER)
    typestore()
    wake = Wake()
    session = ros_session(endpoint, serve)
    try:
        space = RosSpace(session, domain, distro, wake)
        graph = GraphFeed(space)
        check_graph(graph, distro, 0.0 if serve else GRAPH_S)
        with Interrupts() as interrupts, listen(found, frozenset(SOURCES), every=True, wake=wake, eager=EAGER) as ear:
            bridge = Bridge(space, ear, sim_time=sim_time, tf_per_robot=tf_per_robot)
            how = "router at" if serve else "through"
            print(f"fleet {found.name} is on ROS domain {domain}, {how} {endpoint}", file=sys.stderr, flush=True)
            while interrupts.signal is None:
                wake.wait(PERIOD_S)
                bridge.step(clock.now())
                bridge.warn_of(graph, clock.now())
    finally:
        session.close()
    facts = {**msgspec.to_builtins(space.counters), "fleet_dropped": ear.dropped}
    print(msgspec.json.encode(facts).decode() if as_json else ", ".join(f"{n} {name}" for name, n in facts.items()))
    return 0


def check_graph(graph: GraphFeed, distro: Distro, wait_s: float) -> None:
    """Raise Refused if a bridge is there already, or nodes of a distribution that would hear nothing."""
    clock.sleep(wait_s)
    seen = graph.poll(clock.now())
    others = [node for node in seen.nodes() if node.name == BRIDGE_NODE]
    if others:
        raise Refused(
            f"another bridge is on domain {others[0].domain} ({others[0].full_name}): stop it, or say --domain"
        )
    foreign, right = (seen.hashed(), "jazzy") if distro == "humble" else (seen.hashless(), "humble")
    if foreign:
        raise Refused(
            f"--distro {distro}: {foreign[0]} speaks another key format and would hear nothing: say --distro {right}"
        )


class Bridge:
    """State of one bridge; `step` passes on what came in since the last call."""

    def __init__(self, space: RosSpace, ear: Subscriber, *, sim_time: bool, tf_per_robot: bool) -> None:
        self._space = space
        self._ear = ear
        self._operator = Operator(ear.fleet.name, clock.wall_ms())
        self._output = RosOutput(space, tf_per_robot=tf_per_robot, sim_time=sim_time)
        self._mapping = FleetMapping(tf_per_robot=tf_per_robot, sim_time=sim_time, heard=self._output.heard)
        self._clocks = SenderClocks(time.time_ns() - round(1e9 * clock.now()), sim_time=sim_time)
        self._orders = OperatorInput(self._output.node, self._order, self._warn)
        self._warned: set[str] = set()

    def step(self, now: float) -> None:
        """Publish what the fleet said, and pass on what ROS users ordered."""
        arrivals = self._ear.take()
        self._follow_robots()
        present = self._output.robots
        for arrival, message in arrivals:
            if isinstance(message, Truth):
                self._clocks.see_world(arrival.at, message.time_s)
                continue
            owner = arrival.key.split("/", 3)[2]
            robot = robot_id_of(owner)
            if self._clocks.ready and (not robot or robot in present):
                stamp_ns = self._clocks.stamp_ns(message.header, arrival.at)
                self._output.publish(self._mapping.update(stamp_ns, owner, message))
        if self._clocks.ready:
            self._output.publish(self._mapping.tick(self._clocks.now_ns(now)))
        self._orders.step(self._mapping.leader, now)

    def warn_of(self, graph: GraphFeed, now: float) -> None:
        """Warn once of nodes that hear nothing of this bridge."""
        seen = graph.poll(now)
        foreign = seen.hashed() if self._space.distro == "humble" else seen.hashless()
        for name in foreign:
            if name not in self._warned and len(self._warned) < 100:
                self._warned.add(name)
                self._warn(f"{name} is of another distribution than --distro {self._space.distro}: it hears nothing")

    def _follow_robots(self) -> None:
        """Declare robots whose tokens appeared, undeclare those whose tokens vanished."""
        living = {robot for name in self._ear.living if (robot := robot_id_of(name))}
        for robot in living - self._output.robots:
            self._output.join(robot)
        for robot in self._output.robots - living:
            self._mapping.forget(robot)
            self._output.leave(robot)

    def _order(self, name: str, **arguments: object) -> None:
        send(self._ear.bus, self._operator.command(name, clock.now(), **arguments))

    def _warn(self, words: str) -> None:
        print(f"lfa ros: {words}", file=sys.stderr, flush=True)
        stamp_ns = self._clocks.now_ns(clock.now())
        self._output.publish([RosMessage("/rosout", stamp_ns, messages.log(stamp_ns, "warn", BRIDGE_NODE, words))])
