"""Simulation of complete agents under a fault schedule; `lease_simulation.py` simulates the leases alone.

Agents, witness, world and codec are the real ones, run by the simulator; bodies have no physics engine.
It accepts the calls of `fault_injector.py`. All gateways start and end with the one world, which resumes from its last
state; a robot and its gateway share a machine, so a cut never separates them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random
from typing import Any

from lfa.agents.agent import Agent
from lfa.deploy.analysis.verification.checker import Arguments, Checker, CheckerGroup
from lfa.deploy.analysis.verification.lease_observer import report_effect
from lfa.deploy.client.operator import Operator
from lfa.deploy.fuzz.agent_processes import AgentProcess, WorldProcess, unread
from lfa.deploy.fuzz.gateways import RunningGateway
from lfa.deploy.fuzz.network import Trace, effect_text
from lfa.deploy.fuzz.observers import GatewayObserver
from lfa.deploy.fuzz.partition import Partitioned
from lfa.deploy.fuzz.schedules import Schedule
from lfa.protocol.incarnations import drawn_at
from lfa.protocol.lease.agreement import agreement_of, digest
from lfa.protocol.lease.effects import BecomeLeader, Effect, StandAside
from lfa.protocol.lease.machine.lease import Lease, Observed
from lfa.protocol.lease.machine.table import LeaseEvent
from lfa.protocol.lease.timing import CONTROL_PERIOD_S, Timing, timing_for, timing_of
from lfa.protocol.messages.codec import Message, encode
from lfa.protocol.messages.consensus import Member
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.stop import StopKnowledge, StopOrder
from lfa.protocol.mission import Leading, Mission
from lfa.protocol.names import WITNESS_ID, robot_id_of, robot_name
from lfa.protocol.node import Node, NodeObserver, PeerDown, PeerUp
from lfa.protocol.runtime.journal import Journal
from lfa.protocol.topics import OPERATOR_NAME, WORLD_NAME, key
from lfa.protocol.transport.message_bus import send
from lfa.protocol.witness import Witness
from lfa.world.checkpoint import resumed
from lfa.world.description.scenario import Lidar, Scenario, SpareRobot, WorldSpec
from lfa.world.physics.kinematics import Kinematic
from lfa.world.simulator import Simulator
from lfa.world.virtual_time import LocalClock
from lfa.world.world import World

FLEET = "whole"
ROAD_M = 100.0
ASIDE_M = 3.0
"""Distance [m] of spares from the road and from each other."""


class AgentSimulation(Partitioned):
    """Simulation of a team with the same operations as `LeaseSimulation`."""

    def __init__(self, schedule: Schedule, road_m: float = ROAD_M) -> None:
        """Create the simulation without starting a process; the goal is `road_m` [m] ahead of the first robot."""
        self.random = Random(schedule.seed)
        leading = Leading(route_m=((road_m, 0.0),))
        robots = tuple(range(1, schedule.robots + 1))
        self.mission = Mission(robots, witness=schedule.witness, profile=schedule.profile, leading=leading)
        self.timing: Timing = timing_of(schedule.profile)
        self.trace: Trace | None = None
        self.wall_ms: dict[int, int] = {}
        """Error [ms] of each host's wall clock, which terms and numbers of incarnations that begin there follow."""
        spares = tuple(spare for spare in schedule.spares if spare not in robots)
        self.robots = (*robots, *spares)
        self.ids = ((WITNESS_ID,) if schedule.witness else ()) + self.robots
        self.rates = schedule.rates
        self.processes: dict[int, AgentProcess] = {}
        self.gateways: dict[int, WorldProcess] = {}
        self.accepted: list[tuple[float, CmdVel]] = []
        self.log: list[tuple[float, int, Effect]] = []
        places = tuple(SpareRobot(spare, (-ASIDE_M * n, -ASIDE_M, 0.0)) for n, spare in enumerate(spares))
        world = WorldSpec(lidar=Lidar(beams=8), spares=places)
        self._scenario = Scenario("A straight road", self.mission, 1e6, world=world, name=FLEET)
        self._operator = Operator(FLEET, 1)
        self._incarnations = 0
        self._agreed: dict[int, int] = {}
        """Digest of what the newest incarnation of each id holds to be agreed."""
        self.simulator = Simulator(schedule.radio, schedule.seed)
        self.link_model = self.simulator.link_model
        self.simulator.refused_leave = True
        self.simulator.taps.append(self._hear)
        self.simulator.reborn = self._reborn
        self.listen(())

    def listen(self, checkers: Sequence[Checker]) -> None:
        """Notify these checkers, and only these, of all events from now on."""
        self._report = CheckerGroup(checkers).report

    # --- virtual time ------------------------------------------------------------------------------------------

    @property
    def now(self) -> float:
        """True time [s]."""
        return self.simulator.now

    def at(self, time: float, what: Callable[..., None], *arguments: Any) -> None:
        """Schedule the call `what(*arguments)` at true time `time` [s]."""
        self.simulator.at(time, lambda: what(*arguments))

    def run(self, until: float) -> AgentSimulation:
        """Execute all events up to true time `until` [s]."""
        self.simulator.run(until)
        return self

    # --- incarnations ------------------------------------------------------------------------------------------

    def start_all(self) -> AgentSimulation:
        """Start the world with its gateways, then all other processes at once."""
        self._report(Checker.names, self.now, self.mission.robots)
        self._start_world(World(FLEET, self._scenario, 1, self._next_incarnation(), start_at=None, bodies=Kinematic))
        for robot_id in self.ids:
            self.start(robot_id)
        return self

    def start(self, robot_id: int, mission: Mission | None = None) -> None:
        """Start a new incarnation with empty memory; a running one of the same id is killed first.

        With `mission`, it holds that one in place of the team's.
        """
        mission = mission or self.mission
        self._agreed[robot_id] = digest(agreement_of(mission, timing_for(mission)))
        if robot_id in self.processes:
            self.kill(robot_id)
        wall_ms = self.wall_ms.get(robot_id, 0)
        number, floor = drawn_at(wall_ms, self._next_incarnation()), max(round(self.now * 1000.0) + wall_ms, 0)
        node: Agent | Witness = (
            Witness(FLEET, number, floor, mission)
            if robot_id == WITNESS_ID
            else Agent(robot_id, number, FLEET, floor, mission, spare=robot_id not in mission.robots)
        )
        clock = LocalClock(self.random.uniform(0.0, 1000.0), self.rates.get(robot_id, 1.0))
        self._watch(node, robot_id, clock)
        self._add(node, clock)

    def _watch(self, node: Agent | Witness, robot_id: int, clock: LocalClock) -> None:
        """Pass what a new incarnation does to the checkers and the trace."""
        member = Member(robot_id, node.incarnation)
        process = self.processes[robot_id] = AgentProcess(self.simulator, node, member, clock)
        node.lease_observer = lambda observed: self._observed(process, observed)
        self._say(robot_id, f"starts, incarnation {member.incarnation}")
        self._report(Checker.lives, self.now, member)
        self._report(Checker.holds, self.now, member, self._agreed[robot_id])

    def _reborn(self, node: Node) -> Journal:
        """Watch the node that goes on under a later number (E23) in the place of one that the simulator has ended."""
        robot_id = robot_id_of(node.name)
        assert isinstance(node, Agent | Witness) and robot_id is not None
        before = self.processes[robot_id]
        self._report(Checker.leads_no_more, self.now, before.member)
        self._report(Checker.ends, self.now, before.member)
        self._watch(node, robot_id, before.clock)
        return unread(node)

    def kill(self, robot_id: int, *, hinted: bool = True) -> None:
        """Kill the process (SIGKILL); with `hinted`, connected processes see its token vanish."""
        process = self.processes[robot_id]
        if process.alive:
            self.simulator.kill(robot_name(robot_id), hinted=hinted)
            self._say(robot_id, "dies")
            self._report(Checker.leads_no_more, self.now, process.member)
            self._report(Checker.ends, self.now, process.member)

    def exit(self, robot_id: int) -> None:
        """Request the process to exit (SIGTERM); a paused process ignores it."""
        process = self.processes[robot_id]
        if process.alive and not process.paused:
            process.leaving = True
            self.simulator.terminate(robot_name(robot_id))

    def hand_over(self, robot_id: int) -> None:
        """Send an operator's request to all agents; the leader obeys."""
        send(self.simulator, self._operator.command("handover", self.now))

    def pause(self, robot_id: int) -> None:
        """Pause the process (SIGSTOP)."""
        if self.processes[robot_id].alive:
            self.processes[robot_id].paused = True
            self.simulator.pause(robot_name(robot_id))

    def resume(self, robot_id: int, shuffled: bool = False) -> None:
        """Resume the process (SIGCONT): send the command held back, then handle the kept messages."""
        process = self.processes[robot_id]
        if process.paused and process.alive:
            process.paused = False
            if process.drawn is not None:
                self.simulator.publish(*process.drawn)
            self.simulator.resume(robot_name(robot_id), shuffled=shuffled)

    def start_gateway(self, robot_id: int) -> None:
        """Restart the world, and with it all gateways, from its saved state."""
        if not self.gateways[robot_id].alive:
            memory = self.gateways[robot_id].world.memory()
            scenario = resumed(self._scenario, memory)
            self._start_world(World(FLEET, scenario, 1, self._next_incarnation(), None, Kinematic, memory))

    def kill_gateway(self, robot_id: int) -> None:
        """Kill the world, and with it all gateways."""
        process = self.gateways[robot_id]
        if process.alive:
            process.alive = False
            self.simulator.kill(WORLD_NAME)
            self._say(WITNESS_ID, "world dies")

    def hint(self, about: int, *observers: int, up: bool = False) -> None:
        """Deliver a liveliness event about `about` to `observers`, true or false."""
        member = self.processes[about].member
        event = (PeerUp if up else PeerDown)(robot_name(about), member.incarnation)
        self.simulator.hint(event, [robot_name(observer) for observer in observers])

    def latch(self, robot_id: int, incarnation: int) -> None:
        """Deliver the liveliness event of the agent's vanished token to the robot's gateway, true or false."""
        self.simulator.hint(PeerDown(robot_name(robot_id), incarnation), [WORLD_NAME])

    # --- the fleet stop ----------------------------------------------------------------------------------------

    def report(self, fact: Callable[[Checker, *Arguments], None], *arguments: *Arguments) -> None:
        """Notify the checkers of a fact that another part of the simulation has observed."""
        self._report(fact, *arguments)

    def host_of_gateway(self, robot_id: int) -> int:
        """Return the id of the host of a robot's gateway, its own: operators reach it as they reach its agent."""
        return robot_id

    def gateway_now(self, robot_id: int) -> RunningGateway | None:
        """Return a robot's gateway with its own time [s]; None while the world is down or has not begun."""
        process = self.gateways.get(robot_id)
        if process is None or not process.alive or robot_id not in process.world.gateways:
            return None
        return RunningGateway(process.world.gateways[robot_id], process.clock.local(self.now))

    def stop_known(self, robot_id: int) -> StopKnowledge | None:
        """Return what a robot's agent knows of the fleet stop; None while it does not run."""
        process = self.processes.get(robot_id)
        core = process.node.core if process is not None and isinstance(process.node, Agent) else None
        return core.stop_known if process is not None and process.alive and core is not None else None

    def tell_stop(self, robot_id: int, order: StopOrder) -> None:
        """Deliver an order of the fleet stop to a robot's agent."""
        self.simulator.deliver(robot_name(robot_id), key(FLEET, OPERATOR_NAME, "stop"), encode(order))

    # --- the network -------------------------------------------------------------------------------------------

    def _tell_cuts(self) -> None:
        self._report(Checker.parts, self.now, self.cuts)

    def lose_late(self, within_s: float) -> None:
        """Drop the messages in transit that would arrive later than `within_s` [s] from now."""
        self.simulator.lose_late(self.now + within_s)

    def step_wall(self, robot_id: int, by_s: float) -> None:
        """Set a host's wall clock wrong by `by_s` [s]."""
        self.wall_ms[robot_id] = round(by_s * 1000.0)
        self._report(Checker.wall_steps, self.now, robot_id)

    def tell_healed(self) -> None:
        """Notify the checkers of the ended processes, and that the last fault is over."""
        for process in self.processes.values():
            if not process.alive:
                self._report(Checker.ends, self.now, process.member)
        self._report(Checker.heals, self.now, 4.0 * self.link_model.radio.prompt_s + CONTROL_PERIOD_S)

    def _start_world(self, world: World) -> None:
        clock = LocalClock(self.random.uniform(0.0, 1000.0), self.rates.get(-1, 1.0))
        process = WorldProcess(world, clock)
        self.gateways = dict.fromkeys(self.robots, process)
        self._say(WITNESS_ID, "world starts")
        for robot_id in self.robots:
            self._report(Checker.gateway_starts, self.now, robot_id, self.now + self.timing.grant_s / clock.rate)
        self._add(world, clock, GatewayObserver(self.simulator, world, self._report, self.accepted))

    def _add(self, node: Node, clock: LocalClock, *observers: NodeObserver) -> None:
        self.simulator.add(node, unread(node), clock, observers)

    def _next_incarnation(self) -> int:
        self._incarnations += 1
        return self._incarnations

    # --- facts for the checkers --------------------------------------------------------------------------------

    def _observed(self, process: AgentProcess, observed: Observed) -> None:
        if observed.event is LeaseEvent.PROMISE:
            self._report(Checker.promises, self.now, *observed.given)
        for effect in observed.effects:
            self._say(process.id, effect_text(effect))
            if isinstance(effect, StandAside):
                self._report(Checker.leads_no_more, self.now, process.member)
                self._report(Checker.ends, self.now, process.member)
            if isinstance(effect, BecomeLeader):
                self.log.append((self.now, process.id, effect))
            bound_until = self.now + self.timing.grant_s / process.clock.rate
            report_effect(self._report, effect, process.member, self.now, bound_until, process.clock.true)

    def _hear(self, _now: float, key: str, payload: bytes, message: Message) -> None:
        if isinstance(message, CmdVel) and message.as_leader:
            process = self.processes.get(robot_id_of(message.header.sender) or WITNESS_ID)
            if process is not None and process.member.incarnation == message.header.incarnation:
                process.drawn = key, payload

    def _say(self, who: int, what: str) -> None:
        if self.trace is not None:
            self.trace(self.now, who, what)

    # --- queries -----------------------------------------------------------------------------------------------

    def leaders(self) -> list[int]:
        """Return the ids whose lease is valid now by their own clocks."""
        living = [(i, p.clock.local(self.now), p.lease) for i, p in sorted(self.processes.items()) if p.alive]
        return [i for i, local, lease in living if lease is not None and lease.may_command(local)]

    def lease_of(self, robot_id: int) -> Lease:
        """Return the lease of the newest incarnation of an id, which must have started."""
        lease = self.processes[robot_id].lease
        assert lease is not None, robot_id
        return lease
