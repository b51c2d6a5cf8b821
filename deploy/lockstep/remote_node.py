"""A node whose core runs in another process: its last known state, and the host that calls it there.

What a node receives on a topic that does not wake it (`protocol/topics.py`) it reads at its next deadline. Such calls
are granted together with the next one, and must then answer nothing and leave the deadline where it was.
"""

from __future__ import annotations

from collections import deque
from typing import Any, Protocol

from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.grants import CallResult, GrantedCall, NodeState
from lfa.protocol.node import Envelope, Local, Received
from lfa.protocol.runtime.journal import Journal
from lfa.protocol.runtime.node_host import NodeHost, Sent, encode_local
from lfa.protocol.topics import TOPIC, address


class RemoteNode:
    """State of a node as its process has last told it; calls go through its `RemoteHost`."""

    defer_hellos = defer_grants = False

    def __init__(self, name: str, incarnation: int, first: CallResult) -> None:
        """Take over the node's state from the hello of its process."""
        assert first.state is not None
        self.name = name
        self.incarnation = incarnation
        self.started_with: dict[str, Any] = first.state.started_with
        self._deadline = first.deadline
        self.set_state(first.state)

    def set_state(self, state: NodeState) -> None:
        """Take over what the process says that has changed."""
        self.interests = frozenset(state.interests)
        self.finished = state.finished
        self.refusal = state.refusal

    def set_deadline(self, deadline: float) -> None:
        self._deadline = deadline

    def next_deadline(self) -> float:
        return self._deadline

    def receive(self, received: Received) -> list[Envelope]:
        """Raise AssertionError: only the host calls this node."""
        raise AssertionError(f"{self.name} runs elsewhere: {received}")

    def tick(self, now: float) -> list[Envelope]:
        """Raise AssertionError: only the host calls this node."""
        raise AssertionError(f"{self.name} runs elsewhere: tick at {now}")


class Caller(Protocol):
    """Executes calls in the processes of the nodes."""

    def results(self, host: RemoteHost, call: GrantedCall) -> None:
        """Put results into `host.known`, that of `call` first, unless its process has ended."""

    def ended(self, host: RemoteHost) -> None:
        """End the process of a node that takes part no longer."""


class RemoteHost(NodeHost):
    """Host of a `RemoteNode`: keeps its journal, and what is granted, deferred and known of it."""

    def __init__(self, node: RemoteNode, journal: Journal, caller: Caller) -> None:
        super().__init__(node, journal)
        self.remote = node
        self.deferred: list[GrantedCall] = []
        """Calls that go with the next grant, before its first other one."""
        self.known: deque[tuple[GrantedCall, CallResult]] = deque()
        """Calls that the process has executed ahead of the run's time, with their results."""
        self._caller = caller

    def deliver(self, now: float, key: str, message: Message | Local, payload: bytes) -> Sent:
        """Deliver a message or local event to the process, or keep it for the next grant."""
        call = GrantedCall(now, key, payload) if key else GrantedCall(now, "", encode_local(message))
        if waits(call) and not self._is_known(call):
            self.deferred.append(call)
            sent: Sent = []
        else:
            sent = self._called(call)
        if key:
            self.journal.add("message", now, key, payload, sent)
        else:
            self.journal.add("local", now, "", call.payload, sent)
        return sent

    def tick(self, now: float) -> Sent:
        """Tick the node in its process."""
        sent = self._called(GrantedCall(now))
        self.journal.add("tick", now, "", b"", sent)
        return sent

    def end(self) -> None:
        """Close the journal and end the process."""
        super().end()
        self._caller.ended(self)

    def _is_known(self, call: GrantedCall) -> bool:
        return bool(self.known) and self.known[0][0] == call

    def _called(self, call: GrantedCall) -> Sent:
        """Return what the node publishes at `call`; nothing once its process has ended."""
        if not self._is_known(call):
            assert not self.known, f"{self.node.name} was granted {self.known[0][0]}, and now gets {call}"
            self._caller.results(self, call)
            if not self.known:
                return []
        _, result = self.known.popleft()
        self.remote.set_deadline(result.deadline)
        if result.state is not None:
            self.remote.set_state(result.state)
        return result.sent


def waits(call: GrantedCall) -> bool:
    """Return True for a message that does not wake its receiver."""
    where = address(call.key) if call.key else None
    return where is not None and where.topic in TOPIC and not TOPIC[where.topic].wakes
