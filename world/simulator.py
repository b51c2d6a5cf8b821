"""Discrete-event simulator in virtual time: deliveries and deadlines of any Nodes, with codec and journals.

The same seed gives the same run: all randomness comes from one generator, ties are broken by order of insertion, and
no real clock is read. Each node has its own monotonic clock (offset and rate), as processes on several machines do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from random import Random
from typing import Any

from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message, decode
from lfa.protocol.messages.grants import GrantedCall
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.names import robot_name
from lfa.protocol.node import (
    Local,
    Node,
    NodeObserver,
    PeerDown,
    PeerUp,
    RouterLost,
    Stop,
    Vitals,
    lacks_messages,
    may_end,
    reborn,
)
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.runtime.node_host import NodeHost, Sent, encode_local
from lfa.protocol.topics import NO_ECHO, TOPIC, address, alive_key, matches
from lfa.protocol.transport.link_model import LinkModel, Radio
from lfa.protocol.transport.links import Links
from lfa.world.routes import Routes
from lfa.world.virtual_time import LocalClock, VirtualTime

LOCAL_DELAY_S = 0.0003  # a robot and its own hardware: one hop over a unix socket
HINT_DELAY_S = (0.001, 0.005)  # after a kill the process's token vanishes within this [s] (zenoh.md section 2)
VITALS_S = 1.0
FINISH_S_MAX = 1.0

Tap = Callable[[float, str, bytes, Message], None]


class _SimulatedNode:
    """One running process: its host, its clock, its subscriptions, and the messages queued while it is stopped."""

    def __init__(self, host: NodeHost, clock: LocalClock) -> None:
        self.host = host
        self.node: Node = host.node
        self.clock = clock
        self.token = alive_key(_fleet(self.node), self.node.name, self.node.incarnation)
        self.gone = False
        self.deadline: float | None = None
        self.interests: frozenset[str] = frozenset()
        self.paused = False
        self.links = Links()
        self.waiting: list[tuple[str, Message | Local, bytes]] = []
        self.lag_s = 0.0
        """Largest lateness [s] of a tick since the last vital signs: that of one which was due while it was paused."""
        self.paused_at = 0.0
        self.owes_vitals = False
        """True if vital signs were due while it was paused: they follow when it goes on."""
        self.stop_by: float | None = None


class Simulator(VirtualTime):
    """Event loop that runs Nodes in true time from 0. `now` is true time [s]; taps get every published message."""

    def __init__(self, radio: Radio, seed: int) -> None:
        super().__init__()
        self.taps: list[Tap] = []
        self.reborn: Callable[[Node], Journal] = _unjournalled
        """Called with a node that goes on under a later number (E23), before it starts; returns its journal."""
        self.make_host: Callable[[Node, Journal, Sequence[NodeObserver]], NodeHost] = NodeHost
        """Makes the host of a node that starts: another one calls a node that runs elsewhere."""
        self._random = Random(f"air-{seed}")
        self.link_model = LinkModel(radio, self._random)
        self.refused_leave = False
        """True if a node that cannot take part leaves, as its process would, in place of ending the simulation."""
        self.deaf: set[tuple[str, str]] = set()
        """Pairs (receiver, sender) of names between which a router lost the receiver's declarations, until it declares
        its subscriptions again."""
        self.loses_declarations = False
        """True while routers lose all declarations, also those made again."""
        self._processes: dict[str, _SimulatedNode] = {}
        self._routes: Routes[_SimulatedNode] = Routes()

    @property
    def names(self) -> list[str]:
        return list(self._processes)

    def add(
        self, node: Node, journal: Journal, clock: LocalClock | None = None, observers: Sequence[NodeObserver] = ()
    ) -> None:
        """Start a process now. The others get a liveliness event for its token, and it gets theirs.

        `observers` hear each input of the node.
        """
        process = _SimulatedNode(self.make_host(node, journal, observers), clock or LocalClock())
        self._processes[node.name] = process
        self._routes.add(process, node.name)
        self._refresh(process)
        self._announce(process.token, PeerUp(node.name, node.incarnation), LOCAL_DELAY_S)
        self._plan(process)
        self.at(self.now + VITALS_S, self._vitals, process)

    def runs(self, node: Node) -> bool:
        """Return True if this incarnation of the node is running."""
        process = self._processes.get(node.name)
        return process is not None and process.node is node

    def kill(self, name: str, *, hinted: bool = True) -> None:
        """Simulate SIGKILL: the process sends nothing more; if `hinted`, the others get PeerDown within 5 ms."""
        process = self._processes[name]
        self._remove(process)
        low, high = HINT_DELAY_S
        if hinted:
            delay_s = low + (high - low) * self._random.random()
            self._announce(process.token, PeerDown(name, process.node.incarnation), delay_s)

    def hint(self, event: PeerUp | PeerDown | RouterLost, observers: Sequence[str]) -> None:
        """Deliver a liveliness event to `observers`, true or false."""
        for process in [self._processes[name] for name in observers if name in self._processes]:
            self._give(process, "", event, b"")

    def deliver(self, name: str, key: str, payload: bytes) -> None:
        """Deliver a message from outside the simulation to the process `name` alone, now, if it runs."""
        if name in self._processes:
            self._give(self._processes[name], key, decode(payload, TOPIC[key.split("/")[3]].type), payload)

    def pause(self, name: str) -> None:
        """Simulate SIGSTOP: the process does nothing, and its messages are queued."""
        process = self._processes[name]
        process.paused, process.paused_at = True, self.now

    def resume(self, name: str, *, shuffled: bool = False) -> None:
        """Simulate SIGCONT: deliver the queued messages at once; of state topics only the newest, as a real inbox."""
        process = self._processes[name]
        process.paused = False
        due_at = max(process.clock.true(process.node.next_deadline()), process.paused_at)
        process.lag_s = max(process.lag_s, self.now - due_at)
        waiting, process.waiting = process.waiting, []
        if shuffled:
            self._random.shuffle(waiting)
        newest = {key: index for index, (key, _, _) in enumerate(waiting) if key}
        for index, (key, message, payload) in enumerate(waiting):
            where = address(key) if key else None
            if where is not None and TOPIC[where.topic].state and newest[key] != index:
                continue
            self._give(process, key, message, payload)
        self._tick(process, process.node.next_deadline())
        if process.owes_vitals:
            self._tell_vitals(process)

    def terminate(self, name: str) -> None:
        """Simulate SIGTERM: the node gets Stop and may send for up to `FINISH_S_MAX` before it leaves."""
        process = self._processes[name]
        process.stop_by = self.now + FINISH_S_MAX
        self._give(process, "", Stop(), b"")

    def lose_late(self, by: float) -> None:
        """Drop the messages in transit that would arrive later than true time `by` [s]."""
        self.lose(by, (self._give,))

    def publish(self, key: str, payload: bytes) -> None:
        """Publish a message from outside the simulation, such as an operator's, to subscribers of `key` and to taps."""
        topic = TOPIC[key.split("/")[3]]
        message = decode(payload, topic.type)
        for tap in self.taps:
            tap(self.now, key, payload, message)
        for process, _ in self._routes.of(key).receivers:
            self.at(self.now + LOCAL_DELAY_S, self._give, process, key, message, payload, topic.wakes)

    def upcoming(self) -> Iterator[tuple[NodeHost, GrantedCall]]:
        """Yield the next calls of all nodes that nothing can change or precede any more, in their order.

        What a node publishes from now on arrives later than these, after at least the shortest delay of a link. A
        node's calls after one of unknown content are left out.
        """
        unknown = set()
        for when, action, arguments in self.planned(self.now + min(LOCAL_DELAY_S, self.link_model.radio.delay_s)):
            process = arguments[0] if arguments else None
            if not isinstance(process, _SimulatedNode) or process.gone or process.paused or process in unknown:
                continue
            now = process.clock.local(when)
            if action == self._give and isinstance(arguments[2], Local):
                yield process.host, GrantedCall(now, "", encode_local(arguments[2]))
            elif action == self._give:
                yield process.host, GrantedCall(now, arguments[1], arguments[3])
            elif action == self._due and process.deadline == arguments[1]:
                yield process.host, GrantedCall(max(now, arguments[1]))
            elif action != self._due:
                unknown.add(process)

    # --- one call of one node ---------------------------------------------------------------------------------

    def _give(
        self, process: _SimulatedNode, key: str, message: Message | Local, payload: bytes, wakes: bool = True
    ) -> None:
        """Deliver a message or local event. What `wakes` nobody changes no deadline: a real loop would see it later."""
        if process.gone:
            return
        if process.paused:
            process.waiting.append((key, message, payload))
            return
        clock = process.clock
        now = clock.offset_s + clock.rate * self.now
        if not key and isinstance(message, Local):
            process.links.see(message, now)
        sent = process.host.deliver(now, key, message, payload)
        if sent or wakes:
            self._after(process, sent)

    def _tick(self, process: _SimulatedNode, deadline: float) -> None:
        """Call the node's tick if `deadline` [s, its own clock], from its last call, has come; else plan again."""
        if process.gone or process.paused:
            return
        now = process.clock.local(self.now)
        if now >= deadline - 1e-9:
            self._after(process, process.host.tick(max(now, deadline)))
        else:
            self._plan(process)

    def _after(self, process: _SimulatedNode, sent: Sent) -> None:
        node = process.node
        for key, payload in sent:
            self._publish(process, key, payload)
        if node.interests is not process.interests:
            self._refresh(process)
        if self.deaf:
            self._declare_again(process)
        if process.stop_by is None and not may_end(node):
            self._plan(process)
            return
        refusal = node.refusal
        if refusal is not None and not self.refused_leave:
            raise Refused(refusal)
        later = reborn(node)
        if later is not None and process.stop_by is None:
            self._leave(process)
            self.add(later, self.reborn(later), process.clock)
        elif refusal is not None or node.finished or (process.stop_by is not None and self.now > process.stop_by):
            self._leave(process)
        else:
            self._plan(process)

    def _declare_again(self, process: _SimulatedNode) -> None:
        """Declare the node's subscriptions again when it is time, as a real process does."""
        now = process.clock.local(self.now)
        process.links.lacks(lacks_messages(process.node), now)
        if process.links.due(now) and not self.loses_declarations:
            self.deaf = {pair for pair in self.deaf if pair[0] != process.node.name}

    def _plan(self, process: _SimulatedNode) -> None:
        deadline = process.node.next_deadline()
        if deadline != process.deadline:
            process.deadline = deadline
            self.at(max(process.clock.true(deadline), self.now), self._due, process, deadline)

    def _due(self, process: _SimulatedNode, deadline: float) -> None:
        if process.deadline == deadline:
            process.deadline = None
            self._tick(process, deadline)

    def _leave(self, process: _SimulatedNode) -> None:
        if not process.gone:
            self._remove(process)
            self._announce(process.token, PeerDown(process.node.name, process.node.incarnation), LOCAL_DELAY_S)

    def _remove(self, process: _SimulatedNode) -> None:
        del self._processes[process.node.name]
        process.gone = True
        process.host.end()
        self._routes.remove(process, process.interests)

    def _vitals(self, process: _SimulatedNode) -> None:
        if not process.gone:
            process.owes_vitals = process.paused
            if not process.paused:
                self._tell_vitals(process)
            self.at(self.now + VITALS_S, self._vitals, process)

    def _tell_vitals(self, process: _SimulatedNode) -> None:
        lag_s, process.lag_s, process.owes_vitals = process.lag_s, 0.0, False
        self._give(process, "", Vitals(lag_s, 0, process.host.undecodable, 0.0, 0.0), b"")

    # --- between nodes ------------------------------------------------------------------------------------------

    def _publish(self, sender: _SimulatedNode, key: str, payload: bytes) -> None:
        message = sender.host.decoded(key, payload)
        if message is None:
            return
        if type(message) is Truth:
            self.link_model.places = {robot_name(robot.id): (robot.x, robot.y) for robot in message.robots}
        for tap in self.taps:
            tap(self.now, key, payload, message)
        now, give, delays = self.now, self._give, self.link_model.delays
        sent_from, receivers = self._routes.of(key)
        topic = key.split("/", 4)[3]
        wakes = TOPIC[topic].wakes
        if topic in NO_ECHO:
            receivers = [one for one in receivers if one[0] is not sender]
        if self.deaf:
            name = sender.node.name
            receivers = [one for one in receivers if (one[0].node.name, name) not in self.deaf]
        calls: list[tuple[float, Callable[..., None], tuple[Any, ...]]] = []
        for process, place in receivers:
            if sent_from is None or place == sent_from:
                calls.append((now + LOCAL_DELAY_S, give, (process, key, message, payload, wakes)))
                continue
            for delay_s in delays(sent_from, place):
                calls.append((now + delay_s, give, (process, key, message, payload, wakes)))
        self.at_each(calls)

    def _refresh(self, process: _SimulatedNode) -> None:
        """Apply the node's changed interests; it also gets liveliness events for tokens that already exist."""
        new, old = process.node.interests, process.interests
        added = sorted(new - old)
        process.interests = new
        self._routes.change(process, old - new, added)
        tokens = [expression for expression in added if _hears_tokens(expression)]
        if tokens:
            heard = [
                PeerUp(other.node.name, other.node.incarnation)
                for other in self._processes.values()
                if other is not process and any(matches(e, other.token) for e in tokens)
            ]
            at, give = self.now + LOCAL_DELAY_S, self._give
            self.at_each([(at, give, (process, "", event, b"")) for event in heard])

    def _announce(self, token: str, event: PeerUp | PeerDown, delay_s: float) -> None:
        """Deliver the event of a `token` to all who hear of it, but for its owner."""
        at, give = self.now + delay_s, self._give
        hear = [process for process, _ in self._routes.of(token).receivers if process.node.name != event.name]
        self.at_each([(at, give, (process, "", event, b"")) for process in hear])


def _unjournalled(node: Node) -> Journal:
    return Journal(None, Heading(JOURNAL_VERSION, node.name, node.incarnation, node.incarnation, {}))


def _hears_tokens(expression: str) -> bool:
    """Return True if `expression` can match the key of a liveliness token."""
    return expression.endswith("**") or expression.split("/")[3:4] in (["*"], ["alive"])


def _fleet(node: Node) -> str:
    """Return the fleet name in a node's interests."""
    return min(node.interests).split("/")[1]
