"""`lfa-driver --ros`: find a ROS robot in the graph, open it, and watch over who else commands it."""

from __future__ import annotations

import select
import sys
from collections.abc import Collection, Sequence

import msgspec
from msgspec import Struct

from lfa.deploy.robot.ros_base import RosBase
from lfa.deploy.robot.ros_presets import RosPreset, full_name
from lfa.deploy.robot.ros_watchdog import StopTask
from lfa.deploy.robot.watchdog import SILENT_S, Watchdog
from lfa.deploy.ros import messages
from lfa.deploy.ros.graph import TWISTS, RosGraph
from lfa.deploy.ros.session import GraphFeed, RosSpace
from lfa.deploy.ros.types import to_cdr
from lfa.deploy.ros.wire import HASHLESS, Distro, RosEndpoint, check_domain, check_name
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import STILL, Pose2D
from lfa.protocol.mission import Limits
from lfa.protocol.output import visible, write_line
from lfa.protocol.transport.bus import Wake
from lfa.protocol.transport.zenoh_ros import ros_session

DRIVER_NODE = "lfa_driver"
FIND_S, SETTLE_S = 5.0, 0.5
"""Time [s] to wait for a robot in the graph, and for others after the first."""
GRAPH_S = 1.0
WATCHDOG_S = 15.0
FLUSH_S = 0.1
"""Time [s] from the last zero to the end of the session, which would drop it."""
HERE = ("tcp/127.", "tcp/localhost:", "tcp/[::1]:", "unixsock-stream/")
"""Beginnings of endpoints on this machine."""


class RosOptions(Struct, frozen=True):
    """What the command line says about the robot."""

    endpoint: str
    domain: int | None
    """None: that of the only robot there is."""
    namespace: str | None
    """Like `/robot3`, empty for none; None: that of the only robot there is."""
    names: RosPreset
    stops_by_itself: bool = False


class RosRobot:
    """Found ROS robot: its session, its watchdog process, and the hardware interface once the mission is known."""

    def __init__(self, options: RosOptions, start_map: Pose2D | None) -> None:
        """Find the robot and start its watchdog. Raises Refused; nothing is left then."""
        check_names(options)
        check_place(options)
        self._warned: set[str] = set()
        self._start_map = start_map
        self._names = options.names
        self._session = ros_session(options.endpoint, serve=False)
        try:
            listener = self._find(options)
            self._topic, self._stamped = listener.topic, TWISTS[listener.type]
            self._namespace = listener.topic.removesuffix(f"/{options.names.cmd_vel.lstrip('/')}")
            distro: Distro = "humble" if listener.hash == HASHLESS else "jazzy"
            space = RosSpace(self._session, listener.node.domain, distro, Wake())
            self._feed = GraphFeed(space)
            self._node = space.node(DRIVER_NODE, self._namespace)
            self._watchdog = self._start_watchdog(options, listener)
        except BaseException:
            self._session.close()
            raise
        self._graph_due = 0.0
        stamped = "TwistStamped" if self._stamped else "Twist"
        where = f"{self._topic}, domain {listener.node.domain}"
        write_line(visible(f"drives {listener.node.full_name} by {stamped} on {where}"), sys.stdout)

    def make_base(self, _limits: Limits, _now: float) -> RosBase:
        """Return the hardware interface of the robot."""
        return RosBase(
            self._node, self._namespace, self._names, stamped=self._stamped, start_map=self._start_map, warn=self._warn
        )

    def alive(self, now: float) -> None:
        """Report a control period to the watchdog; once a second look for other commanders."""
        self._watchdog.alive(now)
        if now >= self._graph_due:
            self._graph_due = now + GRAPH_S
            graph, odom = self._feed.poll(now), full_name(self._namespace, self._names.odom)
            self._warn_of_others(graph, self._topic, self._own_sessions)
            sources = graph.publishers(odom)
            if len(sources) > 1:
                self._warn("sources", f"{odom}: {two_sources(sources)}")

    def close(self) -> None:
        """Close the session after the last command has left."""
        clock.sleep(FLUSH_S)
        self._session.close()

    def _find(self, options: RosOptions) -> RosEndpoint:
        """Return the subscription to the robot's commands, in any domain if none is named. Raises Refused."""
        domain = options.domain or 0
        feed = GraphFeed(RosSpace(self._session, domain, "jazzy", Wake()), all_domains=options.domain is None)
        try:
            until = clock.now() + FIND_S
            while not listeners(feed.poll(clock.now()), options) and clock.now() < until:
                clock.sleep(0.05)
            clock.sleep(SETTLE_S)
            graph = feed.poll(clock.now())
        finally:
            feed.close()
        listener = only(listeners(graph, options), options)
        namespace = listener.topic.removesuffix(f"/{options.names.cmd_vel.lstrip('/')}")
        check_sources(graph, full_name(namespace, options.names.odom))
        self._warn_of_others(graph, listener.topic, ())
        return listener

    def _warn_of_others(self, graph: RosGraph, topic: str, own_sessions: Collection[str]) -> None:
        for name in graph.publishers(topic, own_sessions):
            self._warn(f"other {name}", f"{name} publishes on {topic} too: two commanders, stop one")

    def _start_watchdog(self, options: RosOptions, listener: RosEndpoint) -> Watchdog:
        zero = messages.twist_stamped(0, STILL, "base_link") if self._stamped else messages.twist(STILL)
        task = StopTask(
            options.endpoint, listener.node.domain, self._namespace, self._topic, listener.type, listener.hash,
            to_cdr(zero), self._stamped,
        )  # fmt: skip
        words = (sys.executable, "-P", "-m", "lfa.deploy.robot.ros_watchdog", str(SILENT_S))
        watchdog = Watchdog((msgspec.json.encode(task).decode(),), words)
        ready, _, _ = select.select([watchdog.output], [], [], WATCHDOG_S)
        session = watchdog.output.readline().decode().strip() if ready else ""
        if not session:
            raise Refused(f"the watchdog process did not open {options.endpoint} within {WATCHDOG_S:g} s")
        self._own_sessions = frozenset({self._session.id, session})
        return watchdog

    def _warn(self, kind: str, words: str) -> None:
        """Print a warning, once per kind."""
        if kind not in self._warned and len(self._warned) < 100:
            self._warned.add(kind)
            write_line(visible(f"lfa-driver: {words}"), sys.stderr)


def check_names(options: RosOptions) -> None:
    """Raise Refused for what can be no domain, namespace or topic of ROS, such as a wildcard."""
    names = options.names
    if options.domain is not None:
        check_domain(options.domain)
    if options.namespace:
        check_name(options.namespace, "--namespace")
    topics = {"--odom": names.odom, "--scan": names.scan, "--cmd-vel": names.cmd_vel, "pose": names.pose}
    for option, name in topics.items():
        if name is not None:
            check_name(full_name("", name), option)


def check_place(options: RosOptions) -> None:
    """Raise Refused if a link to another machine stands before the wheels, unless the robot stops by itself."""
    if options.stops_by_itself or all(one.startswith(HERE) for one in options.endpoint.split(",")):
        return
    raise Refused(
        f"--ros {options.endpoint}: is on another machine, and a lost link would leave the wheels at their last "
        "command: run lfa-driver on the robot, or say --robot-stops-by-itself if it does"
    )


def listeners(graph: RosGraph, options: RosOptions) -> list[RosEndpoint]:
    """Return the subscriptions to velocity commands that the options allow, one per domain and topic."""
    name, namespace, domain = options.names.cmd_vel, options.namespace, options.domain
    found = {
        (one.node.domain, one.topic): one
        for one in graph.endpoints("MS")
        if one.type in TWISTS and domain in (None, one.node.domain)
    }
    if namespace is not None or name.startswith("/"):
        wanted = full_name(namespace or "", name)
        return [one for (_, topic), one in sorted(found.items()) if topic == wanted]
    return [one for (_, topic), one in sorted(found.items()) if topic.endswith(f"/{name}")]


def only(found: Sequence[RosEndpoint], options: RosOptions) -> RosEndpoint:
    """Return the only robot found. Raises Refused for none or several."""
    if not found:
        where = full_name(options.namespace or "...", options.names.cmd_vel)
        domain = "any domain" if options.domain is None else f"domain {options.domain}"
        raise Refused(
            f"no node listens to {where} on {domain} within {FIND_S:g} s: must be a running robot at "
            f"{options.endpoint}; see --domain, --namespace, --cmd-vel"
        )
    if len(found) == 1:
        return found[0]
    topics = sorted({one.topic.removesuffix(f"/{options.names.cmd_vel}") or "/" for one in found})
    if len(topics) == len(found):
        raise Refused(visible(f"several robots are there: say --namespace {' or --namespace '.join(topics)}"))
    domains = sorted({one.node.domain for one in found})
    raise Refused(f"robots of one name are in several domains: say --domain {' or --domain '.join(map(str, domains))}")


def check_sources(graph: RosGraph, odom: str) -> None:
    """Raise Refused if two nodes publish the odometry of one robot: two robots share a namespace."""
    sources = graph.publishers(odom)
    if len(sources) > 1:
        raise Refused(f"{odom}: {two_sources(sources)}")


def two_sources(names: Sequence[str]) -> str:
    """Return what is wrong when the nodes `names` publish one robot's odometry, and what to do."""
    who = f"{len(names)} nodes named {names[0]}" if len(set(names)) == 1 else " and ".join(names)
    return visible(f"published by {who}: two robots share a namespace, give each one of its own")
