"""Leases and gateways of one team in virtual time, without chance: every message takes the delay that a script says.

Only the public interface of `Lease` and `Gateway` is used, so that a trace holds what a caller sees, and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from typing import Any

from lfa.protocol.geometry import Twist
from lfa.protocol.lease.effects import Effect, Send
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.timing import CONTROL_PERIOD_S, timing_of
from lfa.protocol.messages.consensus import Fence, Fenced, LeaseBody, Member, Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.mission import Mission
from lfa.protocol.names import WITNESS_ID, robot_id_of, robot_name
from tests.protocol.lease.traces.trace import Trace

DELAY_S = 0.002
GATEWAY_DELAY_S = 0.0005
HINT_DELAY_S = 0.003
ROUNDING_S = 1e-9
FORWARD = Twist(0.5, 0.0)


class Process:
    """One incarnation of one lease; its clock is the true time."""

    def __init__(self, member: Member, lease: Lease) -> None:
        self.member = member
        self.lease = lease
        self.alive = True
        self.paused = False
        self.kept: list[tuple[Callable[..., None], tuple[Any, ...]]] = []
        """Calls that came during a pause."""
        self.steps = 0


class Stage:
    """The team, its network and its trace. `now` is the time [s] since the beginning."""

    def __init__(self, mission: Mission, trace: Trace) -> None:
        self.mission = mission
        self.timing = timing_of(mission.profile)
        self.trace = trace
        self.now = 0.0
        self.ids = ((WITNESS_ID,) if mission.witness else ()) + mission.robots
        self.processes: dict[int, Process] = {}
        self.gateways = {i: Gateway(i, 1, self.timing, -self.timing.grant_s) for i in mission.robots}
        self.cuts: set[tuple[int, int]] = set()
        self.delays: dict[tuple[int, int], float] = {}
        self.losses: list[tuple[str, int, int]] = []
        """Kind of message, sender and receiver of messages that get lost; a gateway is minus its robot's id."""
        self._heap: list[tuple[float, int, Callable[..., None], tuple[Any, ...]]] = []
        self._number = 0
        self._born: dict[int, int] = {}

    # --- what a script orders -----------------------------------------------------------------------------------

    def run(self, for_s: float) -> None:
        """Let `for_s` [s] pass."""
        until = self.now + for_s
        while self._heap and self._heap[0][0] <= until + ROUNDING_S:
            at, _, what, arguments = heappop(self._heap)
            self.now = max(self.now, at)
            what(*arguments)
        self.now = until

    def start(self, robot_id: int) -> None:
        """Start a new incarnation, with empty memory."""
        incarnation = self._born[robot_id] = self._born.get(robot_id, 0) + 1
        member = Member(robot_id, incarnation)
        lease = Lease(member, self.mission, self.timing, self.now, floor=round(self.now * 1000.0))
        process = self.processes[robot_id] = Process(member, lease)
        self.trace.note(self.now, member, "starts")
        self._tell_token(member, up=True)
        if robot_id in self.gateways:
            self.gateways[robot_id].agent_up(incarnation, self.now)
            self._control(process)
        self._wake(process)

    def kill(self, robot_id: int, *, hinted: bool) -> None:
        """End a process without a word; with `hinted`, all others and its gateway see its token vanish."""
        process = self.processes[robot_id]
        process.alive = False
        self.trace.note(self.now, process.member, "dies" if hinted else "dies, its token stays")
        if hinted:
            self._tell_token(process.member, up=False)
            if robot_id in self.gateways:
                self.gateways[robot_id].agent_down(process.member.incarnation, self.now)

    def pause(self, robot_id: int) -> None:
        """Stop a process: what comes for it is kept, its clock goes on."""
        self.processes[robot_id].paused = True
        self.trace.note(self.now, self.processes[robot_id].member, "is paused")

    def resume(self, robot_id: int) -> None:
        """Continue a process, with all that was kept for it."""
        process = self.processes[robot_id]
        process.paused = False
        self.trace.note(self.now, process.member, "continues")
        kept, process.kept = process.kept, []
        for what, arguments in kept:
            what(*arguments)
        self._wake(process)

    def hint(self, about: int, observers: list[int], *, up: bool) -> None:
        """Deliver a liveliness event about a process, true or not, to `observers` alone."""
        for observer in observers:
            self._hinted(self.processes[observer], self.processes[about].member, up)

    def order(self, robot_id: int, cause: str, call: Callable[[Lease, float], list[Effect]]) -> None:
        """Make a request to one lease, such as to hand over."""
        process = self.processes[robot_id]
        self._after(process, cause, call(process.lease, self.now))

    # --- one call of one lease ----------------------------------------------------------------------------------

    def _deliver(self, process: Process, src: Member, body: LeaseBody) -> None:
        if not process.alive:
            return
        if process.paused:
            process.kept.append((self._deliver, (process, src, body)))
            return
        effects = process.lease.receive(src, body, self.now)
        who = f"gateway{src.id}" if isinstance(body, Fenced) else robot_name(src.id)
        self._after(process, f"{type(body).__name__.upper()} < {who}", effects)

    def _hinted(self, process: Process, about: Member, up: bool) -> None:
        if not process.alive:
            return
        if process.paused:
            process.kept.append((self._hinted, (process, about, up)))
            return
        cause = f"{robot_name(about.id)} is {'there' if up else 'gone'}"
        self._after(process, cause, process.lease.hint(about.id, about.incarnation, up, self.now))

    def _tick(self, process: Process) -> None:
        if not process.alive or process.paused:
            return
        if self.now >= process.lease.next_deadline() - ROUNDING_S:
            self._after(process, "", process.lease.tick(max(self.now, process.lease.next_deadline())))

    def _control(self, process: Process) -> None:
        """Command the own robot fifty times a second, as an agent does; a leader first reads its gateway's state."""
        if not process.alive:
            return
        self._at(CONTROL_PERIOD_S, self._control, process)
        lease, gateway = process.lease, self.gateways[process.member.id]
        if process.paused or not lease.chain:
            return
        if lease.role is Role.LEADER:
            self._after(process, "sensors", lease.gateway_term(gateway.term_max, self.now, gateway.latched))
        as_leader = lease.role is Role.LEADER
        if as_leader and not lease.may_command(self.now):
            return
        process.steps += 1
        header = Header(robot_name(process.member.id), process.member.incarnation, process.steps, self.now)
        stamp = gateway.stamp(self.now)
        cmd = CmdVel(header, FORWARD, lease.term, lease.chain[0], as_leader, stamp, grant_s=lease.grant_s)
        gateway.command(cmd, self.now)
        if as_leader:
            lease.commanded(self.now)

    def _after(self, process: Process, cause: str, effects: list[Effect]) -> None:
        """Write down what a call has done, send its messages, and wake the process in time."""
        self.trace.call(self.now, process.member, process.lease, cause, effects)
        for effect in effects:
            if isinstance(effect, Send):
                self._send(process.member, effect.to, effect.body)
        if process.lease.released and process.alive:
            process.alive = False
            self.trace.note(self.now, process.member, "exits")
            self._tell_token(process.member, up=False)
        self._wake(process)

    def _wake(self, process: Process) -> None:
        deadline = process.lease.next_deadline()
        if deadline < float("inf"):
            self._at(max(deadline - self.now, 0.0), self._tick, process)

    # --- the network --------------------------------------------------------------------------------------------

    def _send(self, src: Member, to: str, body: LeaseBody) -> None:
        if to == "all":
            for other in self.ids:
                if other != src.id:
                    self._post(src, other, body)
        elif to.startswith("gateway"):
            self._post(src, -int(to.removeprefix("gateway")), body)
        else:
            self._post(src, robot_id_of(to) or WITNESS_ID, body)

    def _post(self, src: Member, to: int, body: LeaseBody) -> None:
        link, kind = (src.id, abs(to)), type(body).__name__.upper()
        if link in self.cuts:
            return
        if any(lost[0] in (kind, "*") and lost[1:] == (src.id, to) for lost in self.losses):
            self.trace.lost(self.now, src, to, body)
            return
        if to < 0:
            self._at(self.delays.get(link, GATEWAY_DELAY_S), self._fence, src, -to, body)
        elif to in self.processes:
            self._at(self.delays.get(link, DELAY_S), self._deliver, self.processes[to], src, body)

    def _fence(self, src: Member, robot_id: int, body: LeaseBody) -> None:
        if not isinstance(body, Fence):
            return
        answer = self.gateways[robot_id].fence(body, self.now)
        self.trace.gateway(self.now, robot_id, src, answer)
        asker = self.processes[src.id]
        self._at(GATEWAY_DELAY_S, self._deliver, asker, Member(robot_id, 1), answer)

    def _tell_token(self, member: Member, *, up: bool) -> None:
        for other in self.processes.values():
            if other.member.id != member.id and (member.id, other.member.id) not in self.cuts:
                self._at(HINT_DELAY_S, self._hinted, other, member, up)

    def _at(self, in_s: float, what: Callable[..., None], *arguments: Any) -> None:
        self._number += 1
        heappush(self._heap, (self.now + in_s, self._number, what, arguments))
