"""The processes of a lockstep run: started, granted time, waited for, and ended.

The rule of the time-out: a process that has ended, or that has not answered a grant for `ANSWER_S_MAX` of this
machine's time, counts as killed at the virtual time of that grant. The run goes on without it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from signal import SIGKILL

from lfa.deploy.lockstep.remote_node import RemoteHost, RemoteNode, waits
from lfa.deploy.process.process_group import ProcessGroup, ProcessSpec
from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.messages.grants import HELLO, CallResult, GrantAnswer, GrantedCall, TimeGrant
from lfa.protocol.names import robot_name
from lfa.protocol.node import Node, NodeObserver
from lfa.protocol.runtime.journal import Journal
from lfa.protocol.runtime.node_host import NodeHost
from lfa.protocol.transport.zenoh_grants import GrantHub

START_S_MAX = 30.0
ANSWER_S_MAX = 5.0
MakeSpec = Callable[[int, int, bool], ProcessSpec]
"""Makes the specification of an agent's process from robot, incarnation and whether it is a spare."""
Upcoming = Callable[[], Iterator[tuple[NodeHost, GrantedCall]]]


class GrantedTeam:
    """Agents of a lockstep run. `lost` gets name and reason of a process that counts as killed."""

    def __init__(self, hub: GrantHub, group: ProcessGroup, spec: MakeSpec, interrupted: Callable[[], bool]) -> None:
        self._hub = hub
        self._group = group
        self._spec = spec
        self._interrupted = interrupted
        self._hellos: dict[tuple[str, int], CallResult] = {}
        self._started: set[tuple[str, int]] = set()
        self._numbers = 0
        self.upcoming: Upcoming = lambda: iter(())
        """Yields the calls that are certain to come; set once the run is there."""
        self.lost: Callable[[str, str], None] = lambda name, why: None
        """Told of a process that counts as killed; set once the run is there."""

    # --- start and end of processes ------------------------------------------------------------------------------

    def start(self, robots: Iterable[tuple[int, bool]]) -> None:
        """Start the first process of each robot, given with whether it is a spare, and wait for none of them."""
        for robot_id, spare in robots:
            self._start(robot_id, 1, spare)

    def agent(self, robot_id: int, incarnation: int, fleet: str, floor: int, *, spare: bool) -> Node:
        """Return the node of a robot's process once it is there, and start it if it is not.

        Raises Refused if the process ends before, or does not answer within `START_S_MAX`.
        """
        name = robot_name(robot_id)
        if (name, incarnation) not in self._started:
            self._start(robot_id, incarnation, spare)
        until = clock.now() + START_S_MAX
        while (name, incarnation) not in self._hellos:
            self._take(self._hub.receive())
            how = self._group.exit_of(name)
            if how is not None:
                raise Refused(how)
            if self._interrupted():
                raise Refused(f"{name} was not there yet when the run was interrupted")
            if clock.now() > until:
                raise Refused(f"{name} has not answered within {START_S_MAX:g} s of its start")
        return RemoteNode(name, incarnation, self._hellos[name, incarnation])

    def host(self, node: Node, journal: Journal, observers: Sequence[NodeObserver]) -> NodeHost:
        """Return what calls `node`: here, or in its process."""
        return RemoteHost(node, journal, self) if isinstance(node, RemoteNode) else NodeHost(node, journal, observers)

    def ended(self, host: RemoteHost) -> None:
        """Kill the process of a node that takes part no longer."""
        self._group.signal(host.node.name, SIGKILL)

    def dismiss(self, names: Iterable[str]) -> None:
        """Tell the processes `names` that the run is over."""
        for name in names:
            for started, incarnation in self._started:
                if started == name and self._group.runs(name):
                    self._hub.grant(name, incarnation, TimeGrant(self._numbers + 1, ()))

    def _start(self, robot_id: int, incarnation: int, spare: bool) -> None:
        self._group.start(self._spec(robot_id, incarnation, spare))
        self._started.add((robot_name(robot_id), incarnation))

    def _take(self, arrived: tuple[str, int, GrantAnswer] | None) -> None:
        """Note a hello; what answers an earlier grant comes from a process that counts as killed."""
        if arrived is not None and arrived[2].number == HELLO:
            self._hellos[arrived[:2]] = arrived[2].results[0]

    # --- grants --------------------------------------------------------------------------------------------------

    def results(self, host: RemoteHost, call: GrantedCall) -> None:
        """Let the process of `host` execute `call`, and all processes beside it the calls that are certain to come."""
        batches: dict[RemoteHost, list[GrantedCall]] = {host: [call]}
        for other, next_call in self.upcoming():
            if isinstance(other, RemoteHost) and (other is host or not other.known):
                batches.setdefault(other, []).append(next_call)
        waited = {each: calls for each, calls in batches.items() if not all(map(waits, calls))}
        self._exchange(waited)

    def _exchange(self, batches: dict[RemoteHost, list[GrantedCall]]) -> None:
        """Grant each host its deferred calls and its batch, and wait for the answers."""
        self._numbers += 1
        number, open_hosts = self._numbers, {}
        for host, calls in batches.items():
            grant = TimeGrant(number, (*host.deferred, *calls))
            self._hub.grant(host.node.name, host.node.incarnation, grant)
            open_hosts[host.node.name, host.node.incarnation] = host, grant
        asked_at = clock.now()
        while open_hosts:
            arrived = self._hub.receive()
            if arrived is not None and arrived[2].number == number and arrived[:2] in open_hosts:
                _note(*open_hosts.pop(arrived[:2]), arrived[2])
                continue
            self._take(arrived)
            if arrived is None:
                for lost, why in self._silent(open_hosts, clock.now() - asked_at):
                    del open_hosts[lost.node.name, lost.node.incarnation]
                    lost.deferred.clear()
                    self.lost(lost.node.name, why)

    def _silent(
        self, open_hosts: dict[tuple[str, int], tuple[RemoteHost, TimeGrant]], waited_s: float
    ) -> list[tuple[RemoteHost, str]]:
        """Return the hosts whose processes count as killed, with the reason."""
        found = []
        for (name, _), (host, _) in open_hosts.items():
            how = self._group.exit_of(name)
            if how is None and waited_s > ANSWER_S_MAX:
                how = f"{name} has not answered for {ANSWER_S_MAX:g} s: it counts as killed"
            if how is not None:
                found.append((host, how))
        return found


def _note(host: RemoteHost, grant: TimeGrant, answer: GrantAnswer) -> None:
    """Take over an answer: nothing of the deferred calls, the results of the others. Raises Refused."""
    deferred, host.deferred = len(host.deferred), []
    deadline = host.node.next_deadline()
    for call, result in zip(grant.calls[:deferred], answer.results, strict=False):
        if result.sent or result.state is not None or result.deadline != deadline:
            topic = call.key.rpartition("/")[2]
            raise Refused(
                f"{host.node.name} answers a message on {topic} at once, at {call.at:.3f} s: "
                "in lockstep a topic that wakes nobody must wait for the next tick"
            )
    if len(answer.results) <= deferred:
        raise Refused(f"{host.node.name} has executed {len(answer.results)} calls of a grant of {len(grant.calls)}")
    host.known.extend(zip(grant.calls[deferred:], answer.results[deferred:], strict=False))
