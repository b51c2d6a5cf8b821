"""Simulated processes: each runs one lease by its own clock, and commands its robot while it leads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msgspec import structs

from lfa.deploy.analysis.verification.checker import Checker
from lfa.deploy.fuzz.gateways import GatewaySimulation
from lfa.deploy.fuzz.network import effect_text
from lfa.protocol.fleet_stop.memory import StopMemory
from lfa.protocol.geometry import Twist
from lfa.protocol.lease.effects import AdoptChain, BecomeLeader, Effect, LeaseExtended, Send, StandAside, StepDown
from lfa.protocol.lease.machine.lease import Lease, Observed
from lfa.protocol.lease.machine.table import LeaseEvent, LeaseState
from lfa.protocol.lease.timing import CONTROL_PERIOD_S
from lfa.protocol.messages.consensus import (
    NO_TERM,
    GatewayStamp,
    Grant,
    Hello,
    LeaseBody,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Release,
    Role,
    Superseded,
    Term,
)
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.stop import StopKnowledge, StopOrder
from lfa.protocol.names import robot_name
from lfa.world.simulator import HINT_DELAY_S
from lfa.world.virtual_time import LocalClock

FORWARD = Twist(0.5, 0.0)
FOLLOW_PERIOD_S = 0.1
"""Command period [s] of followers; longer than that of real robots, but it carries terms to their gateways."""
ROUNDING_S = 1e-9
"""Rounding error [s] of converting a time from one clock to another and back."""
INBOX_SIZE_MAX = 500
"""Maximum number of messages kept for a paused process."""
NEVER = float("inf")
VERSIONS_APART = 2
"""Versions of the messages between those of a foreign process and of all others, whichever reads."""

Call = Callable[..., list[Effect]]
Transition = tuple[LeaseEvent, LeaseState, LeaseState]


class Process:
    """One incarnation of one robot's (or the witness's) lease, with its own clock."""

    def __init__(self, member: Member, lease: Lease, clock: LocalClock, robots: tuple[int, ...]) -> None:
        self.member = member
        self.stop = StopMemory(member.id, robots)
        self.id = member.id
        self.lease = lease
        self.clock = clock
        self.alive = True
        self.paused = False
        self.leaving = False
        """True after a request to exit, while the process sends its last messages."""
        self.commanding = False
        self.met: set[Member] = set()
        """Senders whose messages it was given."""
        self.inbox: list[tuple[Call, tuple[Any, ...]]] = []
        """Calls of the lease kept during a pause: method and arguments without the time."""
        self.wakes_at = NEVER
        """True time of the earliest wake-up on the heap."""
        self.drawn: CmdVel | None = None
        """Last command computed as leader; a pause may hold it back."""


class Hosts(GatewaySimulation):
    """Gateways and processes; `processes` holds the newest incarnation of each id, alive or not."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.transitions: set[Transition] = set()
        """Transitions that any lease has made; coverage for a guided search."""
        self.processes: dict[int, Process] = {}
        self.foreign: set[Member] = set()
        """Processes that speak a version of the messages which the others cannot read (E35)."""
        self.log: list[tuple[float, int, Effect]] = []
        """`BecomeLeader`, `StepDown` and `StandAside` effects, each with its true time [s] and the id."""
        self._addresses = {name: to for i in self.ids for name, to in ((robot_name(i), i), (f"gateway{i}", -i))}
        self._others = {i: tuple(other for other in self.ids if other != i) for i in self.ids}

    # --- the fleet stop ----------------------------------------------------------------------------------------

    def stop_known(self, robot_id: int) -> StopKnowledge | None:
        """Return what a robot's process knows of the fleet stop; None while it does not run."""
        process = self.processes.get(robot_id)
        return process.stop.known if process is not None and process.alive else None

    def tell_stop(self, robot_id: int, order: StopOrder) -> None:
        """Deliver an order of the fleet stop to a robot's process; a paused one misses it."""
        process = self.processes.get(robot_id)
        if process is not None and process.alive and not process.paused:
            process.stop.order(order)

    def _tell_stop_of_gateway(self, process: Process, known: StopKnowledge) -> None:
        process.stop.hear_gateway(known)
        self._report(Checker.told_of_stop, self.now, process.member, process.id)

    # --- inputs ------------------------------------------------------------------------------------------------

    def deliver(self, process: Process, method: Call, arguments: tuple[Any, ...]) -> None:
        """Call a method of the lease, or keep the call until the end of a pause."""
        if not process.paused:
            self.take(process, method, arguments)
        elif len(process.inbox) < INBOX_SIZE_MAX:
            process.inbox.append((method, arguments))

    def take(self, process: Process, method: Call, arguments: tuple[Any, ...]) -> None:
        """Call a method of the lease at its local time, and execute the effects."""
        if type(arguments[0]) is Member and arguments[0] not in process.met:
            process.met.add(arguments[0])
            self._report(Checker.meets, self.now, process.member, arguments[0])
        self.carry_out(process, method(*arguments, process.clock.local(self.now)))

    def observed(self, who: Member, observed: Observed) -> None:
        """Note a transition of `who`, and notify the checkers of a promise and of a RELEASE that a lease receives."""
        self.transitions.add((observed.event, observed.before, observed.after))
        if observed.event is LeaseEvent.PROMISE:
            self._report(Checker.promises, self.now, *observed.given)
        elif observed.event is LeaseEvent.RELEASE:
            self._report(Checker.hears_release, self.now, who, observed.given[1].term)

    def wake_at(self, process: Process, true: float) -> None:
        """Schedule a wake-up of the process at a true time [s], unless an earlier one is scheduled."""
        if true < process.wakes_at:
            process.wakes_at = true
            self.at(true, self._wake, process)

    def _wake(self, process: Process) -> None:
        if process.wakes_at > self.now:
            return  # set before the deadline moved
        process.wakes_at = NEVER
        if not process.alive or process.paused:
            return
        local, deadline = process.clock.local(self.now), process.lease.next_deadline()
        if local < deadline - ROUNDING_S:
            self.wake_at(process, process.clock.true(deadline))  # the deadline has moved since
        else:
            self.carry_out(process, process.lease.tick(max(local, deadline)))

    def _arrive(self, src: Member, to: int, body: LeaseBody) -> None:
        process = self.processes.get(to)
        if process is not None and process.alive:
            self.hear(process, src, body)

    def hear(self, process: Process, src: Member, body: LeaseBody) -> None:
        """Deliver a message as `process` reads it, which may speak another version of the messages than `src` (E35)."""
        if (src in self.foreign) != (process.member in self.foreign) and isinstance(body, Prepare | Propose | Hello):
            body = structs.replace(body, wire=body.wire + VERSIONS_APART)
        self.deliver(process, process.lease.receive, (src, body))

    def _at_gateway(self, src: Member, robot_id: int, body: LeaseBody) -> None:
        answered = self.fence(robot_id, body)
        if answered is not None:
            self._post(answered[0], self.host_of_gateway(robot_id), src.id, answered[1])

    # --- outputs -----------------------------------------------------------------------------------------------

    def carry_out(self, process: Process, effects: list[Effect]) -> None:
        """Execute the effects of a lease; end the process if the lease is released, else update its wake-up."""
        for effect in effects:
            if self.trace is not None:
                self.trace(self.now, process.id, effect_text(effect))
            if isinstance(effect, Send):
                self._send(process, effect)
            else:
                self._note(process, effect)
        lease = process.lease
        if lease.released or any(isinstance(effect, StandAside) for effect in effects):
            process.alive = False
            if self.trace is not None:
                self.trace(self.now, process.id, "exits")
            self.tell_end(process)
            self.tell_token(process.member, up=False)
            return
        deadline = process.clock.true(lease.next_deadline())
        if deadline < process.wakes_at:
            self.wake_at(process, max(self.now, deadline))

    def _note(self, process: Process, effect: Effect) -> None:
        """Notify the checkers of an effect other than a message; a new leader commands at once."""
        match effect:
            case AdoptChain(config=config):
                self._report(Checker.adopts, self.now, process.member, config)
            case StandAside():
                self.log.append((self.now, process.id, effect))
            case StepDown():
                self.log.append((self.now, process.id, effect))
                self._report(Checker.leads_no_more, self.now, process.member)
            case BecomeLeader(term=term, expiry=expiry):
                self._tell_leads(process, term, expiry)
                self.log.append((self.now, process.id, effect))
                if not process.commanding:
                    process.commanding = True
                    self.lead(process)
            case LeaseExtended(term=term, expiry=expiry):
                self._tell_leads(process, term, expiry)

    def _tell_leads(self, process: Process, term: Term, expiry: float) -> None:
        self._report(Checker.leads, self.now, process.member, term, process.clock.true(expiry))

    def tell_end(self, process: Process) -> None:
        """Notify the checkers that a process has ended."""
        self._report(Checker.leads_no_more, self.now, process.member)
        self._report(Checker.ends, self.now, process.member)

    def tell_token(self, member: Member, up: bool) -> None:
        """Deliver the liveliness event of a member to the connected processes, each after a random delay."""
        for other in list(self.processes.values()):
            connected = (member.id, other.id) not in self.cuts
            if other.alive and other.id != member.id and connected:
                delay = self.random.uniform(*HINT_DELAY_S)
                self.at(self.now + delay, self._hinted, other, (member.id, member.incarnation, up))

    def _hinted(self, process: Process, hint: tuple[int, int, bool]) -> None:
        if process.alive:
            self._report(Checker.hinted, self.now, process.member, Member(*hint[:2]))
            self.deliver(process, process.lease.hint, hint)

    def _send(self, process: Process, send: Send) -> None:
        body = send.body
        self._witness(process, body)
        if send.to == "all":
            for to in self._others[process.id]:
                self._post(process.member, process.id, to, body)
        else:
            self._post(process.member, process.id, self._addresses[send.to], body)

    def _post(self, src: Member, here: int, to: int, body: LeaseBody) -> None:
        """Send a message from the host `here`; a negative `to` addresses a gateway."""
        start = self.now
        if self.filter is not None:
            extra = self.filter(src.id, to, body)
            if extra is None:
                return
            start += extra
        for delay in self.delays(here, to):
            if to < 0:
                self.at(start + delay, self._at_gateway, src, -to, body)
            else:
                self.at(start + delay, self._arrive, src, to, body)

    def _witness(self, process: Process, body: LeaseBody) -> None:
        """Notify the checkers of a message of a process. A PROPOSE by its holder is also a grant of its own voter."""
        if isinstance(body, Grant):
            self._tell_grant(process, body)
        elif isinstance(body, Propose):
            self._report(Checker.proposes, self.now, process.member, body)
            if body.holder == process.member:
                self._tell_grant(process, Grant(body.term, body.round, body.config.version, 0.0))
        elif isinstance(body, Release):
            self._report(Checker.releases, self.now, body.term)
        elif isinstance(body, Promise | Nack | Prepare | Superseded):
            self._report(Checker.says, self.now, process.member, body)

    def _tell_grant(self, process: Process, grant: Grant) -> None:
        until = self.now + self._grant_s / process.clock.rate
        self._report(Checker.grants, self.now, process.member, grant, until)

    # --- commands ----------------------------------------------------------------------------------------------

    def lead(self, process: Process) -> None:
        """Run one control period of the leader: read the stamp, then the clock, then the lease, then send."""
        lease = process.lease
        if not process.alive or lease.role is not Role.LEADER:
            process.commanding = False
            return
        self.at(self.now + CONTROL_PERIOD_S, self.lead, process)
        if process.paused:
            return
        stamp = self.stamp(process.id)
        local = process.clock.local(self.now)
        if stamp is None or not lease.may_command(local):
            return
        gateway = self.gateways[process.id].gateway
        self._tell_stop_of_gateway(process, gateway.stop.known)
        self.carry_out(process, lease.gateway_term(gateway.term_max, local, gateway.latched))
        if not lease.may_command(local):
            return
        process.drawn = self._drawn(process, lease.term, process.id, True, stamp)
        self.command(process.id, process.drawn)
        lease.commanded(local)

    def follow(self, process: Process) -> None:
        """Send one command of a follower under the term of its config, and schedule the next."""
        if not process.alive:
            return
        self.at(self.now + FOLLOW_PERIOD_S, self.follow, process)
        lease = process.lease
        self._hear_gateway(process)
        if process.paused or lease.role is not Role.FOLLOWER or lease.config.version.term == NO_TERM:
            return
        stamp = self.stamp(process.id)
        if stamp is not None:
            term, holder = lease.config.version.term, lease.chain[0]
            self.command(process.id, self._drawn(process, term, holder, False, stamp))

    def _hear_gateway(self, process: Process) -> None:
        """Tell the process the term and the agent that its robot's gateway knows, if connected (E23, E24).

        A leader, which hears the term with the answers to its commands, is told of the agent alone.
        """
        host = self.gateways.get(process.id)
        if host is None or not host.alive or process.paused:
            return
        if (self.host_of_gateway(process.id), process.id) in self.cuts:
            return
        gateway, lease = host.gateway, process.lease
        lease.learn_incarnation(gateway.agent)
        if lease.role is Role.LEADER:
            self.carry_out(process, [])
            return
        self._tell_stop_of_gateway(process, gateway.stop.known)
        self.carry_out(process, lease.gateway_term(gateway.term_max, process.clock.local(self.now), gateway.latched))

    def _drawn(self, process: Process, term: Term, holder: int, as_leader: bool, stamp: GatewayStamp) -> CmdVel:
        header = Header(robot_name(process.id), process.member.incarnation, 0, process.clock.local(self.now))
        known, grant_s = process.stop.known, process.lease.grant_s
        return CmdVel(header, FORWARD, term, holder, as_leader, stamp, known, grant_s)
