"""Granted time: a process whose node gets inputs and times in grants of a lockstep run, in place of bus and clock.

A grant is a batch of calls of the node, each with its virtual time. The answer has the result of each call. The node
stops early where a call moved its deadline before the next call: the run then grants the rest again, in another order.
"""

from __future__ import annotations

import sys
from typing import Protocol

import msgspec

from lfa.protocol.messages.codec import BadMessage
from lfa.protocol.messages.grants import HELLO, CallResult, GrantAnswer, GrantedCall, NodeState, TimeGrant
from lfa.protocol.node import Local, Node
from lfa.protocol.output import write_line
from lfa.protocol.runtime import log_capture
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.runtime.node_host import NodeHost
from lfa.protocol.runtime.vital_signs import keep_one_heap, settle
from lfa.protocol.topics import message_in


class GrantSource(Protocol):
    """Where grants come from and answers go to."""

    def hello(self, answer: GrantAnswer) -> TimeGrant:
        """Say that the node is there until a grant comes, and return that."""

    def exchange(self, answer: GrantAnswer) -> TimeGrant:
        """Send an answer and return the next grant."""


class GrantedNode:
    """Node that executes grants."""

    def __init__(self, node: Node) -> None:
        """Host `node`; the run that grants the calls keeps its journal."""
        self.node = node
        heading = Heading(JOURNAL_VERSION, node.name, node.incarnation, node.incarnation, {})
        self._host = NodeHost(node, Journal(None, heading))
        self._said = _state(node)

    def hello(self) -> GrantAnswer:
        """Return the answer that introduces the node."""
        state = msgspec.structs.replace(self._said, started_with=self.node.started_with)
        return GrantAnswer(HELLO, (CallResult([], self.node.next_deadline(), state),))

    def answer(self, grant: TimeGrant) -> GrantAnswer:
        """Execute the calls of `grant`, up to the first that is overtaken, and return their results.

        Raises BadMessage for a payload that is no message of its key.
        """
        results: list[CallResult] = []
        before = self.node.next_deadline()
        for call in grant.calls:
            if results and (_overtaken(call, before, self.node.next_deadline()) or _is_over(self.node)):
                break
            results.append(self._execute(call))
        return GrantAnswer(grant.number, tuple(results))

    def _execute(self, call: GrantedCall) -> CallResult:
        host = self._host
        if call.key:
            message = message_in(call.key, call.payload)
            if message is None:
                raise BadMessage(f"{call.key}: a granted payload is no message of its key")
            sent = host.deliver(call.at, call.key, message, call.payload)
        elif call.payload:
            sent = host.deliver(call.at, "", _local_decoder.decode(call.payload), b"")
        else:
            sent = host.tick(call.at)
        for key, payload in sent:
            if key.endswith(log_capture.EVENT_ENDING):
                log_capture.tell(key, payload, round(1000.0 * call.at))
        state = self._said
        node = self.node
        if (frozenset(state.interests), state.finished, state.refusal) == (node.interests, node.finished, node.refusal):
            return CallResult(sent, node.next_deadline())
        self._said = _state(node)
        return CallResult(sent, node.next_deadline(), self._said)


def run_granted(node: Node, source: GrantSource) -> int:
    """Run `node` in granted time until the run is over; return the exit code 0."""
    keep_one_heap()
    granted = GrantedNode(node)
    settle()
    grant = source.hello(granted.hello())
    while grant.calls:
        grant = source.exchange(granted.answer(grant))
    write_line(f"{node.name}: ended, the lockstep run is over", sys.stdout)
    return 0


def _overtaken(call: GrantedCall, before: float, deadline: float) -> bool:
    """Return True if the deadline has moved, so that the node would be ticked before `call`, or not by it."""
    if deadline == before:
        return False
    is_tick = not call.key and not call.payload
    return is_tick or deadline <= call.at


def _is_over(node: Node) -> bool:
    return node.finished or node.refusal is not None


def _state(node: Node) -> NodeState:
    return NodeState(tuple(sorted(node.interests)), node.finished, node.refusal)


_local_decoder = msgspec.msgpack.Decoder(Local)
