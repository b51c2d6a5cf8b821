"""A small world for leases alone: processes with clocks of their own, a faulty network, gateways, virtual time.

One heap of (true time, number, event). Everything random comes from one generator, so two arenas with the same seed
and the same calls do the same. Directed tests and `lfa fuzz` drive it; checkers (`deploy/look/checkers.py`)
are told what leaves processes and gateways, in true time, which no process knows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from heapq import heappop, heappush
from random import Random
from typing import Any

from msgspec import Struct

from deploy.look.checkers import Checker, listeners
from protocol.effects import AdoptChain, BecomeLeader, Effect, Send, StepDown
from protocol.gateway import Gateway
from protocol.geometry import Twist
from protocol.lease import Lease
from protocol.messages import (
    NO_TERM,
    CmdVel,
    Fence,
    Grant,
    Header,
    Hello,
    LeaseBody,
    Member,
    Promise,
    Propose,
    Release,
    Term,
)
from protocol.mission import WITNESS_ID, Leading, Mission, Profile, robot_id_of, robot_name
from protocol.timing import CONTROL_PERIOD_S, timing_of

FORWARD = Twist(0.5, 0.0)
FOLLOW_PERIOD_S = 0.1
"""Followers command more rarely here than on the road: enough to carry terms to their gateways."""
ROUNDING_S = 1e-9
"""Of converting a time from one clock to another and back."""
INBOX_SIZE_MAX = 500
"""Messages kept for a process that is paused."""


class Clock(Struct, frozen=True):
    """local = offset + rate * true."""

    offset: float = 0.0
    rate: float = 1.0

    def local(self, true: float) -> float:
        return self.offset + self.rate * true

    def true(self, local: float) -> float:
        return (local - self.offset) / self.rate


class Weather(Struct):
    """What the network does to messages that leave now; times in seconds."""

    delay_min: float = 0.0003
    delay_max: float = 0.002
    loss: float = 0.0
    duplicate: float = 0.0
    tail: float = 0.0
    """Probability of an exponential delay on top, of mean `tail_mean`."""
    tail_mean: float = 0.05
    hint_delay_max: float = 0.005

    def delays(self, random: Random) -> list[float]:
        """How long each copy of a message takes; none when it is lost."""
        if self.loss and random.random() < self.loss:
            return []
        delay = self.delay_min + (self.delay_max - self.delay_min) * random.random()
        if self.tail and random.random() < self.tail:
            delay += random.expovariate(1.0 / self.tail_mean)
        if self.duplicate and random.random() < self.duplicate:
            return [delay, delay + random.uniform(0.0, 2.0 * self.tail_mean)]
        return [delay]


class Process:
    """One life of one robot's (or the witness's) lease, with its own clock."""

    def __init__(self, member: Member, lease: Lease, clock: Clock) -> None:
        self.member = member
        self.id = member.id
        self.lease = lease
        self.clock = clock
        self.alive = True
        self.paused = False
        self.commanding = False
        self.inbox: list[tuple[str, Any]] = []
        """What came during a pause."""
        self.wakes_at = float("inf")
        """True time of the earliest wake-up on the heap."""
        self.drawn: CmdVel | None = None
        """The last command computed as leader: what a pause may hold back."""


class GatewayHost(Struct):
    """One life of one robot's gateway, and its clock."""

    gateway: Gateway
    clock: Clock
    born_at: float
    alive: bool = True


Filter = Callable[[int, int, LeaseBody], float | None]
"""(from, to, body) -> extra delay [s]; None loses the message. Gateways are addressed as minus their robot's id."""


Trace = Callable[[float, int, str], None]
"""(true time [s], id, what it did): for people."""


class Arena:
    def __init__(
        self,
        robots: int = 4,
        *,
        seed: int = 0,
        profile: Profile = "std",
        witness: bool = True,
        rates: dict[int, float] | None = None,
        mission: Mission | None = None,
        weather: Weather | None = None,
        gateways_at_world: bool = False,
        gateway_type: type[Gateway] = Gateway,
    ) -> None:
        self.random = Random(seed)
        self.now = 0.0
        self.mission = mission or Mission(
            robots=tuple(range(1, robots + 1)),
            witness=witness,
            profile=profile,
            leading=Leading(route_m=((1.0, 0.0),)),
        )
        self.timing = timing_of(self.mission.profile)
        self.weather = weather or Weather()
        self.filter: Filter | None = None
        self.trace: Trace | None = None
        self.cuts: set[tuple[int, int]] = set()
        """Directed pairs of ids between which nothing passes."""
        self.ids = ((WITNESS_ID,) if self.mission.witness else ()) + self.mission.robots
        self.rates = rates or {}
        self.processes: dict[int, Process] = {}
        self.gateways: dict[int, GatewayHost] = {}
        self.accepted: list[tuple[float, CmdVel]] = []
        """Leader commands that a gateway obeyed."""
        self.log: list[tuple[float, int, Effect]] = []
        """Every effect but messages and renewals."""
        self._gateways_at_world = gateways_at_world
        self._gateway_type = gateway_type
        self._heap: list[tuple[float, int, Callable[..., None], tuple[Any, ...]]] = []
        self._number = 0
        self._lives = 0
        self.listen(())

    def listen(self, checkers: Sequence[Checker]) -> None:
        """Tell these checkers, and only these, what happens from here on."""
        self._tell = listeners(checkers)

    # --- the course of time ------------------------------------------------------------------------------------

    def at(self, time: float, what: Callable[..., None], *arguments: Any) -> None:
        """`what(*arguments)` when true time reaches `time`."""
        self._number += 1
        heappush(self._heap, (time, self._number, what, arguments))

    def run(self, until: float) -> Arena:
        """All that happens up to true time `until`."""
        heap = self._heap
        while heap and heap[0][0] <= until:
            self.now, _, what, arguments = heappop(heap)
            what(*arguments)
        self.now = until
        return self

    # --- lives -------------------------------------------------------------------------------------------------

    def start_all(self, at: float = 0.0, gateways_shut_s: float = 0.0) -> Arena:
        """Everybody starts at once; gateways have been up before."""
        for robot_id in self.mission.robots:
            self.start_gateway(robot_id, at - self.timing.grant_s + gateways_shut_s)
        for robot_id in self.ids:
            self.at(at, self.start, robot_id)
        return self

    def start(self, robot_id: int) -> None:
        """A new life, with empty memory; a living one of the same id ends first."""
        if robot_id in self.processes and self.processes[robot_id].alive:
            self.kill(robot_id)
        self._lives += 1
        member = Member(robot_id, self._lives)
        clock = Clock(self.random.uniform(0.0, 1000.0), self.rates.get(robot_id, 1.0))
        lease = Lease(member, self.mission, self.timing, clock.local(self.now), floor=round(self.now * 1000.0))
        process = Process(member, lease, clock)
        self.processes[robot_id] = process
        if self.trace is not None:
            self.trace(self.now, robot_id, f"starts, life {self._lives}")
        self._tell_token(member, up=True)
        if robot_id != WITNESS_ID:
            self.at(self.now + self.random.uniform(0.0, FOLLOW_PERIOD_S), self._follow, process)
            host = self.gateways.get(robot_id)
            if host is not None and host.alive:
                host.gateway.agent_up(member.incarnation, host.clock.local(self.now))
        self._wake_at(process, self.now)

    def kill(self, robot_id: int, *, hinted: bool = True) -> None:
        """SIGKILL. With `hinted`, those who are connected hear of the token within `hint_delay_max`."""
        process = self.processes[robot_id]
        if not process.alive:
            return
        process.alive = False
        if self.trace is not None:
            self.trace(self.now, robot_id, "dies")
        for tell in self._tell["leads_no_more"]:
            tell(self.now, process.member)
        if hinted:
            self._tell_token(process.member, up=False)
            self.at(self.now + self.random.uniform(0.001, 0.005), self.latch, robot_id, process.member.incarnation)

    def exit(self, robot_id: int) -> None:
        """SIGTERM: the process says its last words and ends. One that is paused does not hear it."""
        process = self.processes[robot_id]
        if process.alive and not process.paused:
            self._carry_out(process, process.lease.request_release(process.clock.local(self.now)))

    def hand_over(self, robot_id: int) -> None:
        process = self.processes[robot_id]
        if process.alive and not process.paused:
            self._carry_out(process, process.lease.request_handover(process.clock.local(self.now)))

    def forget(self, *lost: Member) -> None:
        """The operator's word to every robot that lives, now."""
        for process in self.processes.values():
            if process.alive and process.id != WITNESS_ID:
                self._deliver(process, "request_forget", (lost,))

    def pause(self, robot_id: int) -> None:
        """SIGSTOP: what comes is kept, the clock goes on."""
        self.processes[robot_id].paused = True

    def resume(self, robot_id: int, shuffled: bool = False) -> None:
        """SIGCONT: the command that was about to leave leaves, then everything that came is handled."""
        process = self.processes[robot_id]
        if not process.paused:
            return
        process.paused = False
        if not process.alive:
            return
        if process.drawn is not None:
            self._command(process, process.drawn)
        inbox, process.inbox = process.inbox, []
        if shuffled:
            self.random.shuffle(inbox)
        for method, arguments in inbox:
            self._take(process, method, arguments)
        self._wake_at(process, self.now)

    def start_gateway(self, robot_id: int, at: float | None = None) -> None:
        """A new life of a robot's gateway; `at` may lie in the past: it has then been up since."""
        born_at = self.now if at is None else at
        self._lives += 1
        clock = Clock(self.random.uniform(0.0, 1000.0), self.rates.get(-robot_id, 1.0))
        gateway = self._gateway_type(robot_id, self._lives, self.timing, clock.local(born_at))
        self.gateways[robot_id] = GatewayHost(gateway, clock, born_at)
        for tell in self._tell["gateway_starts"]:
            tell(self.now, robot_id, born_at + self.timing.grant_s / clock.rate)

    def kill_gateway(self, robot_id: int) -> None:
        self.gateways[robot_id].alive = False

    def latch(self, robot_id: int, incarnation: int) -> None:
        """The robot's gateway sees its agent's token vanish, whatever is true."""
        host = self.gateways.get(robot_id)
        if host is not None and host.alive:
            host.gateway.agent_down(incarnation, host.clock.local(self.now))

    def hint(self, about: int, *observers: int, up: bool = False) -> None:
        """A token that comes or goes as `observers` see it, whatever is true."""
        member = self.processes[about].member
        for observer in observers:
            self._deliver(self.processes[observer], "hint", (member.id, member.incarnation, up))

    # --- the network -------------------------------------------------------------------------------------------

    def cut(self, *groups: tuple[int, ...]) -> None:
        """Nothing passes between different groups, either way; ids in no group form one."""
        rest = tuple(i for i in self.ids if not any(i in g for g in groups))
        sides = [*groups, rest]
        self.cuts |= {(a, b) for one in sides for other in sides if one is not other for a in one for b in other}

    def heal(self) -> None:
        self.cuts.clear()

    def _host_of_gateway(self, robot_id: int) -> int:
        return WITNESS_ID if self._gateways_at_world else robot_id

    def _delays(self, src: int, to: int) -> list[float]:
        """How long each copy of a message takes; none when it is lost."""
        here = abs(src)
        there = to if to >= 0 else self._host_of_gateway(-to)
        if (here, there) in self.cuts:
            return []
        if here == there:
            return [self.random.uniform(0.0001, 0.0005)]
        return self.weather.delays(self.random)

    def _post(self, src: Member, here: int, to: int, body: LeaseBody) -> None:
        """`here` is where it leaves: the id of a host. A negative `to` is a gateway."""
        extra = self.filter(src.id, to, body) if self.filter is not None else 0.0
        if extra is None:
            return
        for delay in self._delays(here, to):
            if to < 0:
                self.at(self.now + delay + extra, self._fence, src, -to, body)
            else:
                self.at(self.now + delay + extra, self._arrive, src, to, body)

    def _arrive(self, src: Member, to: int, body: LeaseBody) -> None:
        process = self.processes.get(to)
        if process is not None and process.alive:
            self._deliver(process, "receive", (src, body))

    def _fence(self, src: Member, robot_id: int, body: LeaseBody) -> None:
        host = self.gateways.get(robot_id)
        if host is None or not host.alive or not isinstance(body, Fence):
            return
        for tell in self._tell["bars"]:
            tell(self.now, robot_id, body.term)
        answer = host.gateway.fence(body, host.clock.local(self.now))
        speaker = Member(robot_id, host.gateway.incarnation)
        self._post(speaker, self._host_of_gateway(robot_id), src.id, answer)

    def _tell_token(self, member: Member, up: bool) -> None:
        for other in list(self.processes.values()):
            connected = (member.id, other.id) not in self.cuts
            if other.alive and other.id != member.id and connected:
                delay = self.random.uniform(0.001, self.weather.hint_delay_max)
                self.at(self.now + delay, self._hinted, other, (member.id, member.incarnation, up))

    def _hinted(self, process: Process, hint: tuple[int, int, bool]) -> None:
        if process.alive:
            self._deliver(process, "hint", hint)

    # --- running the leases ------------------------------------------------------------------------------------

    def _deliver(self, process: Process, method: str, arguments: tuple[Any, ...]) -> None:
        if process.paused:
            if len(process.inbox) < INBOX_SIZE_MAX:
                process.inbox.append((method, arguments))
            return
        self._take(process, method, arguments)

    def _take(self, process: Process, method: str, arguments: tuple[Any, ...]) -> None:
        if method == "receive" and isinstance(arguments[1], Promise):
            for tell in self._tell["promises"]:
                tell(self.now, arguments[0], arguments[1])
        self._carry_out(process, getattr(process.lease, method)(*arguments, process.clock.local(self.now)))

    def _wake(self, process: Process) -> None:
        if process.wakes_at > self.now:
            return  # set before the deadline moved
        process.wakes_at = float("inf")
        if not process.alive or process.paused:
            return
        local, deadline = process.clock.local(self.now), process.lease.next_deadline()
        if local < deadline - ROUNDING_S:
            self._wake_at(process, process.clock.true(deadline))  # the deadline has moved since
        else:
            self._carry_out(process, process.lease.tick(max(local, deadline)))

    def _wake_at(self, process: Process, true: float) -> None:
        if true < process.wakes_at:
            process.wakes_at = true
            self.at(true, self._wake, process)

    def _carry_out(self, process: Process, effects: list[Effect]) -> None:
        for effect in effects:
            if self.trace is not None:
                self.trace(self.now, process.id, told(effect))
            if isinstance(effect, Send):
                self._send(process, effect)
            elif isinstance(effect, AdoptChain):
                for tell in self._tell["adopts"]:
                    tell(self.now, process.member, effect.config)
            elif isinstance(effect, StepDown):
                self.log.append((self.now, process.id, effect))
                for tell in self._tell["leads_no_more"]:
                    tell(self.now, process.member)
            else:
                for tell in self._tell["leads"]:
                    tell(self.now, process.member, effect.term, process.clock.true(effect.expiry))
                if isinstance(effect, BecomeLeader):
                    self.log.append((self.now, process.id, effect))
                    if not process.commanding:
                        process.commanding = True
                        self._lead(process)
        if process.lease.released:
            process.alive = False
            if self.trace is not None:
                self.trace(self.now, process.id, "exits")
            for tell in self._tell["leads_no_more"]:
                tell(self.now, process.member)
            self._tell_token(process.member, up=False)
            return
        self._wake_at(process, max(self.now, process.clock.true(process.lease.next_deadline())))

    def _send(self, process: Process, send: Send) -> None:
        self._witnessed(process, send.body)
        if send.to == "all":
            for to in self.ids:
                if to != process.id:
                    self._post(process.member, process.id, to, send.body)
        elif send.to.startswith("gateway"):
            self._post(process.member, process.id, -int(send.to.removeprefix("gateway")), send.body)
        else:
            receiver = robot_id_of(send.to)
            assert receiver is not None, send
            self._post(process.member, process.id, receiver, send.body)

    def _witnessed(self, process: Process, body: LeaseBody) -> None:
        """Tell the checkers what leaves a process. A PROPOSE by its holder is its own voter's grant as well."""
        until = self.now + self.timing.grant_s / process.clock.rate
        if isinstance(body, Grant):
            for tell in self._tell["grants"]:
                tell(self.now, process.member, body, until)
        elif isinstance(body, Propose):
            for tell in self._tell["proposes"]:
                tell(self.now, process.member, body)
            if body.holder == process.member:
                for tell in self._tell["grants"]:
                    tell(self.now, process.member, Grant(body.term, body.round, body.config.version, 0.0), until)
        elif isinstance(body, Release):
            for tell in self._tell["releases"]:
                tell(self.now, body.term)

    # --- commands ----------------------------------------------------------------------------------------------

    def _stamp(self, process: Process) -> Any:
        """The newest gateway stamp that reached the robot: one hop old. None when it hears no gateway."""
        host = self.gateways.get(process.id)
        delay = self.random.uniform(0.0005, 0.002)
        if host is None or not host.alive or self.now - delay < host.born_at:
            return None
        if (self._host_of_gateway(process.id), process.id) in self.cuts:
            return None
        return host.gateway.stamp(host.clock.local(self.now - delay))

    def _lead(self, process: Process) -> None:
        """The leader's control period: read the stamp, then the clock, then the lease, then send."""
        lease = process.lease
        if not process.alive or lease.role != "leader":
            process.commanding = False
            return
        self.at(self.now + CONTROL_PERIOD_S, self._lead, process)
        if process.paused:
            return
        stamp = self._stamp(process)
        local = process.clock.local(self.now)
        if stamp is None or not lease.may_command(local):
            return
        gateway = self.gateways[process.id].gateway
        self._carry_out(process, lease.gateway_term(gateway.term_max, local, gateway.latched))
        if not lease.may_command(local):
            return
        process.drawn = self._drawn(process, lease.term, process.id, True, stamp)
        self._command(process, process.drawn)
        lease.commanded(local)

    def _follow(self, process: Process) -> None:
        if not process.alive:
            return
        self.at(self.now + FOLLOW_PERIOD_S, self._follow, process)
        lease = process.lease
        if process.paused or lease.role != "follower" or lease.config.version.term == NO_TERM:
            return
        stamp = self._stamp(process)
        if stamp is not None:
            self._command(process, self._drawn(process, lease.config.version.term, lease.chain[0], False, stamp))

    def _drawn(self, process: Process, term: Any, holder: int, as_leader: bool, stamp: Any) -> CmdVel:
        header = Header(robot_name(process.id), process.member.incarnation, 0, process.clock.local(self.now))
        return CmdVel(header, FORWARD, term, holder, as_leader, stamp)

    def _command(self, process: Process, cmd: CmdVel) -> None:
        for delay in self._delays(process.id, -process.id):
            self.at(self.now + delay, self._commanded, process.id, cmd)

    def _commanded(self, robot_id: int, cmd: CmdVel) -> None:
        host = self.gateways.get(robot_id)
        if host is None or not host.alive:
            return
        local = host.clock.local(self.now)
        if host.gateway.command(cmd, local) is not None:
            return
        if cmd.as_leader:
            self.accepted.append((self.now, cmd))
        for tell in self._tell["obeys"]:
            tell(self.now, robot_id, cmd, local - cmd.gateway.time)
        for tell in self._tell["bars"]:
            tell(self.now, robot_id, cmd.term)

    # --- what tests ask ----------------------------------------------------------------------------------------

    def leaders(self) -> list[int]:
        """Ids whose lease is valid at this moment by their own clocks."""
        return [
            i for i, p in sorted(self.processes.items()) if p.alive and p.lease.may_command(p.clock.local(self.now))
        ]

    def lease_of(self, robot_id: int) -> Lease:
        return self.processes[robot_id].lease


def told(effect: Effect) -> str:
    """An effect in the few words that a column has room for."""
    match effect:
        case Send(to=to, body=body):
            detail = f" r{body.round}" if isinstance(body, Propose | Grant) else ""
            return f"{type(body).__name__.lower()} {body_term(body)}{detail} > {to}"
        case BecomeLeader(term=term):
            return f"LEADS {short(term)}"
        case StepDown(term=term, cause=cause):
            return f"STOPS {short(term)} {cause}"
        case AdoptChain(config=config):
            return f"chain {[m.id for m in config.chain]} v{short(config.version.term)}.{config.version.seq}"
    return "extends"


def body_term(body: LeaseBody) -> str:
    return "" if isinstance(body, Hello) else short(body.term)


def short(term: Term) -> str:
    return f"{term.n}.{term.issuer}"
