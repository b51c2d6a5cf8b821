"""Outward half of the bridge: nodes and publishers for the fleet and each of its robots, fed by the mapping."""

from __future__ import annotations

from collections.abc import Iterable

from lfa.deploy.ros.mapping import RosMessage
from lfa.deploy.ros.session import NodeHandle, RosPublisher, RosSpace
from lfa.deploy.ros.topics import RosTopic, fleet_topics, robot_topics

BRIDGE_NODE = "lfa_bridge"
ROBOT_NODE = "lfa"


class RosOutput:
    """Publishers by topic: those of the fleet from the start, those of a robot from `join` to `leave`."""

    def __init__(self, space: RosSpace, *, tf_per_robot: bool, sim_time: bool) -> None:
        self._space = space
        self._tf_per_robot = tf_per_robot
        self._publishers: dict[str, RosPublisher] = {}
        self._robots: dict[int, tuple[NodeHandle, tuple[RosTopic, ...]]] = {}
        self.node = space.node(BRIDGE_NODE)
        self._declare(self.node, fleet_topics(tf_per_robot=tf_per_robot, sim_time=sim_time))

    @property
    def robots(self) -> frozenset[int]:
        return frozenset(self._robots)

    def heard(self, topic: str) -> bool:
        """Return True if someone listens to `topic`."""
        publisher = self._publishers.get(topic)
        return publisher is not None and publisher.heard()

    def join(self, robot: int) -> None:
        """Declare a robot's node `/robotN/lfa` and its topics."""
        node = self._space.node(ROBOT_NODE, f"/robot{robot}")
        topics = robot_topics(robot, tf_per_robot=self._tf_per_robot)
        self._robots[robot] = (node, topics)
        self._declare(node, topics)

    def leave(self, robot: int) -> None:
        """Undeclare a robot's node and topics, so that ROS users see it leave."""
        node, topics = self._robots.pop(robot)
        for topic in topics:
            self._publishers.pop(topic.name, None)
        node.close()

    def publish(self, sent: Iterable[RosMessage]) -> None:
        """Publish messages; one for a robot that has left is dropped."""
        for one in sent:
            publisher = self._publishers.get(one.topic)
            if publisher is not None:
                publisher.publish(one.message)

    def _declare(self, node: NodeHandle, topics: Iterable[RosTopic]) -> None:
        for topic in topics:
            self._publishers[topic.name] = node.publisher(topic.name, topic.type, topic.qos)
