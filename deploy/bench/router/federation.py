"""Federation of machines in the simulator: what their routers carry, by the subscriptions of real agents.

Each machine has a router and as many robots as any other, with their drivers, in the order of the chain; routers are
linked each with each, as `lfa up` links them. A router passes a message on once to each process of its machine that
follows the key and, if the message comes from its own machine, once to each router behind which another one does. What
nobody follows stays in its process.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import ceil

from msgspec import Struct

from lfa.agents.team_state import table_s
from lfa.deploy.run.simulate import SimulatedRun
from lfa.protocol.errors import Refused
from lfa.protocol.lease.machine.voting import HELLO_HEARTBEATS
from lfa.protocol.lease.membership import VOTERS_MAX
from lfa.protocol.lease.timing import lengths_of, timing_for
from lfa.protocol.messages.codec import Message
from lfa.protocol.names import WITNESS_ID, robot_id_of
from lfa.protocol.node import Node, NodeObserver
from lfa.protocol.runtime.journal import Journal
from lfa.protocol.runtime.node_host import NodeHost
from lfa.protocol.topics import DRIVER_PREFIX, NO_ECHO, TOPIC, address
from lfa.protocol.transport.link_model import ends_of, place_of
from lfa.world.description.load import Scenario, draw, load
from lfa.world.routes import Routes

SCENARIO, SEED = "straight", 1
CONTROL_HZ = 10.0
FROM_S = 1.0
"""Time [s] of a run from which it is counted: the leader leads, and the chain is whole."""
SLICE_S = 1.0
"""Time [s] for whose messages the subscriptions at its end are taken."""
HEAD = 0
"""Machine with the head of the chain: the leader, and the voters if it has as many robots."""


class Federation(Struct, frozen=True):
    """Team on machines with as many robots each."""

    robots: int
    machines: int

    @property
    def scenario(self) -> Scenario:
        """Scenario of the team, without scanners."""
        return load(SCENARIO, [f"mission.control_hz={CONTROL_HZ}", "world.lidar.beams=0"], self.robots)

    def machine_of(self, place: str) -> int:
        """Return the machine of a robot or its driver, by its name; of all else, the first one."""
        robot = robot_id_of(place.replace(DRIVER_PREFIX, "robot", 1))
        return HEAD if robot in (None, WITNESS_ID) else (robot - 1) * self.machines // self.robots


class RouterTraffic(Struct):
    """Messages that one router has passed on, by topic: to processes of its machine, and to other routers."""

    to_processes: Counter[str]
    to_routers: Counter[str]

    @property
    def passed_on(self) -> int:
        """Number of messages, counted once for each receiver."""
        return self.to_processes.total() + self.to_routers.total()


def simulated(federation: Federation) -> tuple[list[RouterTraffic], float]:
    """Simulate, and return what each router passes on from one row of a robot to its next, and for how long [s].

    Raises Refused if the team reaches its goal before.
    """
    mission = federation.scenario.mission
    duration_s = ceil(table_s(federation.robots) * mission.control_hz) * mission.control_period_s
    said: Counter[str] = Counter()
    nodes: dict[str, Node] = {}

    def record(t: float, key: str, _message: Message) -> None:
        if t >= FROM_S:  # the first election of many robots is millions of messages
            said[key] += 1

    def host(node: Node, journal: Journal, observers: Sequence[NodeObserver]) -> NodeHost:
        nodes[node.name] = node
        return NodeHost(node, journal, observers)

    run = SimulatedRun(draw(federation.scenario, SEED), SEED, (), record, None, make_host=host)
    run.advance(FROM_S)
    routers = [RouterTraffic(Counter(), Counter()) for _ in range(federation.machines)]
    for until_s in (*(FROM_S + n * SLICE_S for n in range(1, ceil(duration_s / SLICE_S))), FROM_S + duration_s):
        run.advance(until_s)
        if run.verdict is not None:
            raise Refused(f"{federation.robots} robots: the run has ended after {run.now:.3g} s, before it was counted")
        count(federation, said, {name: node.interests for name, node in nodes.items()}, routers)
        said.clear()
    run.close()
    return routers, duration_s


def count(
    federation: Federation,
    said: Mapping[str, int],
    interests: Mapping[str, frozenset[str]],
    routers: Sequence[RouterTraffic],
) -> None:
    """Add to `routers` what they carry of messages, given as a number by key, for processes with these interests."""
    routes: Routes[str] = Routes()
    for name, followed in interests.items():
        routes.add(name, name)
        routes.change(name, (), followed)
    for key, number in said.items():
        where = address(key)
        assert where is not None, key
        sender, place = ends_of(key)
        own = federation.machine_of(sender or where.owner)
        silent = where.owner if where.topic in NO_ECHO else None
        hear = Counter(
            federation.machine_of(place or place_of(name)) for name, _ in routes.of(key).receivers if name != silent
        )
        for machine, processes in hear.items():
            routers[machine].to_processes[where.topic] += number * processes
        if elsewhere := len(hear.keys() - {own}):
            routers[own].to_routers[where.topic] += number * elsewhere


def predicted(federation: Federation) -> tuple[float, float]:
    """Return the messages a second that the router of the leader's machine passes on, and that of another one.

    deploy/docs/performance.md has the terms. Each machine has at least as many robots as there are voters.
    """
    mission = federation.scenario.mission
    robots, machines, timing = federation.robots, federation.machines, timing_for(mission)
    each = robots / machines
    rows_hz = robots / table_s(robots)
    own_hz = 3.0 * mission.control_hz + (TOPIC["localization"].rate_hz or 0.0)
    round_hz, formation_hz = 1.0 / timing.heartbeat_s, TOPIC["formation"].rate_hz or 0.0
    hello_hz = 1.0 / (HELLO_HEARTBEATS * lengths_of(timing)[0].heartbeat_s)
    to_all_hz = round_hz + formation_hz
    common = each * (own_hz + rows_hz + to_all_hz) + rows_hz / machines * (machines - 1) + mission.control_hz
    head = (robots - VOTERS_MAX) * hello_hz + (VOTERS_MAX - 1) * round_hz + (machines - 1) * to_all_hz
    return common + head, common + each * hello_hz
