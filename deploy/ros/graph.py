"""The ROS graph as the liveliness tokens show it: who is there, which type, and who else commands a robot. Pure.

A token may outlive its process by the session's lease (60 s for genuine nodes): judge a robot by the age of its
odometry, never by its tokens.
"""

from __future__ import annotations

from collections.abc import Collection

from lfa.deploy.ros.wire import HASHLESS, Kind, RosEndpoint, RosNode, read_token

TOKENS_MAX = 20_000
"""Maximum number of tokens kept: about 1000 nodes; further ones are dropped and counted."""


class RosGraph:
    """Nodes and endpoints by their tokens, updated by `update`."""

    def __init__(self) -> None:
        self._known: dict[str, RosNode | RosEndpoint] = {}
        self.dropped = 0
        """Number of tokens that were malformed or too many."""

    def update(self, token: str, *, up: bool) -> None:
        """Add or remove a token; any other key is dropped and counted."""
        if not up:
            self._known.pop(token, None)
            return
        entity = read_token(token)
        if entity is None or len(self._known) >= TOKENS_MAX:
            self.dropped += 1
            return
        self._known[token] = entity

    def nodes(self) -> list[RosNode]:
        return [entity for entity in self._known.values() if isinstance(entity, RosNode)]

    def endpoints(self, kind: Kind, topic: str | None = None) -> list[RosEndpoint]:
        """Return the endpoints of `kind`, of one topic or service or of all."""
        found = (entity for entity in self._known.values() if isinstance(entity, RosEndpoint))
        return [one for one in found if one.kind == kind and topic in (None, one.topic)]

    def hashless(self) -> list[str]:
        """Return the names of nodes that write no type hashes: Humble, which newer distributions do not hear."""
        found = (entity for entity in self._known.values() if isinstance(entity, RosEndpoint))
        return sorted({one.node.full_name for one in found if one.hash == HASHLESS})

    def hashed(self) -> list[str]:
        """Return the names of nodes that write type hashes: Jazzy and newer, which Humble does not hear."""
        found = (entity for entity in self._known.values() if isinstance(entity, RosEndpoint))
        return sorted({one.node.full_name for one in found if one.hash != HASHLESS})

    def publishers(self, topic: str, own_sessions: Collection[str] = ()) -> list[str]:
        """Return the names of the nodes that publish on `topic`, without those of `own_sessions`.

        A name comes twice if two nodes have it: two robots of one make are told apart by their sessions only.
        """
        nodes = {one.node for one in self.endpoints("MP", topic) if one.node.session not in own_sessions}
        return sorted(node.full_name for node in nodes)


TWISTS = {"geometry_msgs/msg/Twist": False, "geometry_msgs/msg/TwistStamped": True}
"""Command types, each with whether it is stamped."""
