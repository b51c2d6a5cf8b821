"""Team of robots as far as the fleet stop goes: gateways, and agents that command them; no leases and no bodies.

An agent here commands from its first moment on, before it has heard of a leader, and never ceases: more than any real
one does. Terms rise when a robot takes the lead, and are told once over the links; gateways are those of the product,
with fence, deadman and latch. So commands come, and are refused, in all ways that a lease could bring about.
"""

from __future__ import annotations

from functools import partial

from lfa.deploy.analysis.verification.checker import Checker
from lfa.deploy.fuzz.gateways import GatewaySimulation
from lfa.deploy.fuzz.lease_processes import FORWARD
from lfa.deploy.fuzz.schedules import Schedule
from lfa.protocol.fleet_stop.memory import StopMemory
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import NO_TERM, Fence, Member, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.stop import StopKnowledge, StopOrder
from lfa.protocol.names import WITNESS_ID, robot_name
from lfa.world.simulator import HINT_DELAY_S
from lfa.world.virtual_time import LocalClock

COMMAND_S = 0.03
"""Command period [s]: shorter than the shortest deadman, so that wheels turn on."""
FIRST_TERM = Term(1, 1, 0)
"""Term of who has heard of no leader."""


class Commander:
    """One incarnation of a robot's agent: what it knows of the fleet stop, and the term under which it commands."""

    def __init__(self, member: Member, robots: tuple[int, ...], clock: LocalClock) -> None:
        self.member = member
        self.id = member.id
        self.stop = StopMemory(member.id, robots)
        self.clock = clock
        self.term = FIRST_TERM
        self.alive = True
        self.paused = False
        self.seq = 0
        self.drawn: CmdVel | None = None
        """Last command; one that a pause holds back is sent at its end."""

    @property
    def leads(self) -> bool:
        """True if this incarnation took the lead with the newest term that it knows."""
        return (self.term.issuer, self.term.incarnation) == (self.member.id, self.member.incarnation)


class StopTeam(GatewaySimulation):
    """Gateways and commanders of one schedule; `processes` holds the newest commander of each robot, alive or not."""

    def __init__(self, schedule: Schedule) -> None:
        self.robots = tuple(range(1, schedule.robots + 1))
        timing, at_world = timing_of(schedule.profile), WITNESS_ID if schedule.gateways_at_world else None
        make = partial(Gateway, operator_timeout_s=schedule.operator_timeout_s)
        ids = (WITNESS_ID, *self.robots)
        super().__init__(schedule.seed, ids, schedule.radio, at_world, timing, schedule.rates, make)
        self.processes: dict[int, Commander] = {}
        self.elections = 0
        """Number of terms under which somebody took the lead."""
        self._traced: dict[int, str] = {}

    # --- incarnations ------------------------------------------------------------------------------------------

    def start_all(self) -> None:
        """Start all gateways, which have been open for long, and all agents."""
        self._report(Checker.names, self.now, self.robots)
        for robot in self.robots:
            self.start_gateway(robot, self.now - self.timing.grant_s)
        for robot in self.robots:
            self.start(robot)
        self._take_lead()

    def start(self, robot: int) -> None:
        """Start a new incarnation of a robot's agent with empty memory, unless one runs."""
        if robot in self.processes and self.processes[robot].alive:
            return
        self._incarnations += 1
        clock = LocalClock(self.random.uniform(0.0, 1000.0), self.rates.get(robot, 1.0))
        agent = Commander(Member(robot, self._incarnations), self.robots, clock)
        self.processes[robot] = agent
        self._tell(robot, f"starts, incarnation {agent.member.incarnation}")
        self._report(Checker.lives, self.now, agent.member)
        running = self.gateway_now(robot)
        if running is not None:
            running.gateway.agent_up(agent.member.incarnation, running.local_s)
        self.at(self.now + self.random.uniform(0.0, COMMAND_S), self._command, agent)

    def kill(self, robot: int) -> None:
        """Kill the agent of a robot; its gateway sees the token vanish."""
        agent = self.processes[robot]
        if agent.alive:
            agent.alive = False
            self._tell(robot, "dies")
            self._report(Checker.ends, self.now, agent.member)
            if agent.leads:
                self.at(self.now + self.timing.act_s, self._take_lead)
            self.at(self.now + self.random.uniform(*HINT_DELAY_S), self.latch, robot, agent.member.incarnation)

    def start_gateway(self, robot_id: int, at: float | None = None) -> None:
        """Start a new incarnation of a robot's gateway, unless one runs; with `at` it has been running since then."""
        if self.gateway_now(robot_id) is None:
            super().start_gateway(robot_id, at)
            self._tell(robot_id, f"gateway starts, incarnation {self.gateways[robot_id].gateway.incarnation}")

    def pause(self, robot: int) -> None:
        """Pause the agent of a robot (SIGSTOP): it hears and says nothing."""
        self.processes[robot].paused = True

    def resume(self, agent: Commander) -> None:
        """Resume an agent (SIGCONT), which sends the command that the pause held back."""
        agent.paused = False
        if agent.alive and agent.drawn is not None:
            self.command(agent.id, agent.drawn)

    def hand_over(self, robot: int) -> None:
        """Let the agent of a robot take the lead: it fences its own gateway, and tells the others its term."""
        agent = self.processes[robot]
        if not agent.alive or agent.paused:
            return
        agent.term = Term(agent.term.n + 1, robot, agent.member.incarnation)
        self.elections += 1
        self._tell(robot, f"leads under term {agent.term.n}")
        self.fence(robot, Fence(NO_TERM, agent.term))
        for other in self.robots:
            for delay_s in self.delays(robot, other) if other != robot else ():
                self.at(self.now + delay_s, self._hear_term, other, agent.term)

    def _take_lead(self) -> None:
        """Let the first robot whose agent runs take the lead, if none leads."""
        alive = [robot for robot in self.robots if self.processes[robot].alive]
        if alive and not self.leaders():
            self.hand_over(alive[0])

    def _hear_term(self, robot: int, term: Term) -> None:
        agent = self.processes[robot]
        if agent.alive and not agent.paused:
            agent.term = max(agent.term, term)

    def leaders(self) -> list[int]:
        """Return the robots that lead for all that they know, that of the newest term first."""
        leading = (agent for agent in self.processes.values() if agent.alive and agent.leads)
        return [agent.id for agent in sorted(leading, key=lambda agent: agent.term, reverse=True)]

    def _tell_cuts(self) -> None:
        """Notify nobody: no invariant of the fleet stop asks who hears whom."""

    def _tell(self, robot: int, text: str) -> None:
        if self.trace is not None:
            self.trace(self.now, robot, text)

    # --- the fleet stop ----------------------------------------------------------------------------------------

    def stop_known(self, robot_id: int) -> StopKnowledge | None:
        """Return what the agent of a robot knows of the fleet stop; None while it does not run."""
        agent = self.processes.get(robot_id)
        return agent.stop.known if agent is not None and agent.alive else None

    def tell_stop(self, robot_id: int, order: StopOrder) -> None:
        """Deliver an order to the agent of a robot; a paused one misses it."""
        agent = self.processes[robot_id]
        if agent.alive and not agent.paused:
            agent.stop.order(order)

    def _trace_known(self, robot: int, agent: StopKnowledge, gateway: StopKnowledge) -> None:
        text = f"agent {_known_text(agent)}, gateway {_known_text(gateway)}"
        if self._traced.get(robot) != text:
            self._traced[robot] = text
            self._tell(robot, text)

    def _command(self, agent: Commander) -> None:
        """Send one command of an agent, by what its gateway tells it, and schedule the next."""
        if not agent.alive:
            return
        self.at(self.now + COMMAND_S, self._command, agent)
        stamp = None if agent.paused else self.stamp(agent.id)
        if stamp is None:
            return
        gateway = self.gateways[agent.id].gateway
        agent.stop.hear_gateway(gateway.stop.known)
        self._report(Checker.told_of_stop, self.now, agent.member, agent.id)
        agent.term, agent.seq = max(agent.term, gateway.term_max), agent.seq + 1
        header = Header(robot_name(agent.id), agent.member.incarnation, agent.seq, agent.clock.local(self.now))
        holder, known = agent.term.issuer, agent.stop.known
        agent.drawn = CmdVel(header, FORWARD, agent.term, holder, agent.leads, stamp, known, self.timing.grant_s)
        self.command(agent.id, agent.drawn)
        if self.trace is not None:
            self._trace_known(agent.id, known, gateway.stop.known)


def _known_text(known: StopKnowledge) -> str:
    """Return what is known of the fleet stop, as short as a column of the trace; `?`: it is not certain."""
    return f"{'stop' if known.word.stand else 'go'} {known.word.epoch}{'' if known.certain else '?'}"
