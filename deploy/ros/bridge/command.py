"""`lfa ros`: a running fleet as ROS 2 topics, until Ctrl-C or SIGTERM.

Two sessions, never one network: an observer of the fleet, and a client of the ROS router or that router itself.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import typer

from lfa.deploy.client.session import find, listen
from lfa.deploy.process.signals import Interrupts
from lfa.deploy.ros.bridge.bridge import EAGER, Bridge
from lfa.deploy.ros.bridge.inward import OperatorInput
from lfa.deploy.ros.bridge.outward import BRIDGE_NODE, RosOutput
from lfa.deploy.ros.session import GraphFeed, RosSpace
from lfa.deploy.ros.wire import Distro, check_domain
from lfa.deploy.terminal_text import print_visible
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.output import visible
from lfa.protocol.runtime.vital_signs import keep_one_heap, settle
from lfa.protocol.transport.bus import Wake
from lfa.protocol.transport.zenoh_ros import ros_session

ROUTER = "tcp/127.0.0.1:7447"
SERVED = "tcp/[::]:7447"
WARNINGS_MAX = 100
GRAPH_S = 1.0
"""Time [s] to wait for the tokens of those who are there already, and period of looking for newcomers."""


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
    keep_one_heap()
    wake = Wake()
    session = ros_session(endpoint, serve)
    try:
        space = RosSpace(session, domain, distro, wake)
        graph = GraphFeed(space)
        check_graph(graph, distro, 0.0 if serve else GRAPH_S)
        with Interrupts() as interrupts, listen(found, frozenset(), every=True, wake=wake, eager=EAGER) as subscriber:
            output = RosOutput(space, tf_per_robot=tf_per_robot, sim_time=sim_time)
            bridge = Bridge(subscriber, output, sim_time=sim_time, tf_per_robot=tf_per_robot)
            orders = OperatorInput(output.node, bridge)
            foreign = ForeignNodes(graph, distro)
            how = "router at" if serve else "through"
            print_visible(
                f"fleet {found.name} is on ROS domain {domain}, {how} {endpoint}", file=sys.stderr, flush=True
            )
            settle()
            while interrupts.signal is None:
                wake.wait(bridge.period_s())
                now = clock.now()
                bridge.step(now)
                orders.step(bridge.leader, now)
                foreign.warn(bridge.warn, now)
    finally:
        session.close()
    facts = {**msgspec.to_builtins(space.counters), "fleet_dropped": subscriber.dropped}
    print_visible(
        msgspec.json.encode(facts).decode() if as_json else ", ".join(f"{n} {name}" for name, n in facts.items())
    )
    return 0


def check_graph(graph: GraphFeed, distro: Distro, wait_s: float) -> None:
    """Raise Refused if a bridge is there already, or nodes of a distribution that would hear nothing."""
    clock.sleep(wait_s)
    seen = graph.poll(clock.now())
    others = [node for node in seen.nodes() if node.name == BRIDGE_NODE]
    if others:
        raise Refused(
            visible(f"another bridge is on domain {others[0].domain} ({others[0].full_name}): stop it, or say --domain")
        )
    foreign, right = (seen.hashed(), "jazzy") if distro == "humble" else (seen.hashless(), "humble")
    if foreign:
        who = f"{foreign[0]} speaks another key format and would hear nothing"
        raise Refused(visible(f"--distro {distro}: {who}: say --distro {right}"))


class ForeignNodes:
    """Nodes that hear nothing of the bridge; each is warned of once, within GRAPH_S."""

    def __init__(self, graph: GraphFeed, distro: Distro) -> None:
        self._graph = graph
        self._distro = distro
        self._warned: set[str] = set()
        self._due = 0.0

    def warn(self, warn: Callable[[str], None], now: float) -> None:
        """Call `warn` for each node of another distribution that has appeared."""
        seen = self._graph.poll(now)
        if now < self._due:
            return
        self._due = now + GRAPH_S
        for name in seen.hashed() if self._distro == "humble" else seen.hashless():
            if name not in self._warned and len(self._warned) < WARNINGS_MAX:
                self._warned.add(name)
                warn(f"{name} is of another distribution than --distro {self._distro}: it hears nothing")
