"""Simulation of leases without agents: processes and gateways with own clocks, a faulty network, virtual time.

Directed tests and `lfa fuzz` drive it. The checkers (`deploy/analysis/verification/`) receive the outputs of processes
and gateways with the true time, which no process knows.
"""

from __future__ import annotations

from functools import partial

from msgspec import structs

from lfa.deploy.analysis.verification.checker import Checker
from lfa.deploy.fuzz.lease_processes import FOLLOW_PERIOD_S, Hosts, Process
from lfa.deploy.fuzz.network import FAIR
from lfa.protocol.incarnations import after, drawn_at
from lfa.protocol.lease.agreement import agreement_of, digest
from lfa.protocol.lease.effects import Effect
from lfa.protocol.lease.gateway import Gateway
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.timing import timing_for
from lfa.protocol.messages.consensus import Member
from lfa.protocol.mission import Leading, Mission, Profile
from lfa.protocol.names import WITNESS_ID
from lfa.protocol.transport.link_model import Radio
from lfa.world.simulator import HINT_DELAY_S
from lfa.world.virtual_time import LocalClock


class LeaseSimulation(Hosts):
    """Simulation of the leases of one team; starts, ends, pauses and disturbs its processes at true times."""

    def __init__(
        self,
        robots: int = 4,
        *,
        seed: int = 0,
        profile: Profile = "std",
        witness: bool = True,
        rates: dict[int, float] | None = None,
        mission: Mission | None = None,
        radio: Radio = FAIR,
        gateways_at_world: bool = False,
        gateway_type: type[Gateway] = Gateway,
        spares: tuple[int, ...] = (),
    ) -> None:
        """Create the simulation; `spares` are robots that run and that the mission does not name."""
        self.mission = mission or Mission(
            robots=tuple(range(1, robots + 1)),
            witness=witness,
            profile=profile,
            leading=Leading(route_m=((1.0, 0.0),)),
        )
        self.robots = (*self.mission.robots, *spares)
        ids = ((WITNESS_ID,) if self.mission.witness else ()) + self.robots
        timing, gateways_at = timing_for(self.mission), WITNESS_ID if gateways_at_world else None
        super().__init__(seed, ids, radio, gateways_at, timing, rates or {}, gateway_type)
        self.wall_ms: dict[int, int] = {}
        """Error [ms] of each host's wall clock, which terms and numbers of incarnations that begin there follow."""

    # --- incarnations ------------------------------------------------------------------------------------------

    def start_all(self, at: float = 0.0, gateways_shut_s: float = 0.0) -> LeaseSimulation:
        """Start all processes at true time `at` [s]; the gateways refuse commands until `gateways_shut_s` later."""
        self._report(Checker.names, at, self.mission.robots)
        for robot_id in self.robots:
            self.start_gateway(robot_id, at - self.timing.grant_s + gateways_shut_s)
        for robot_id in self.ids:
            self.at(at, self.start, robot_id)
        return self

    def start(self, robot_id: int, number: int | None = None, mission: Mission | None = None) -> None:
        """Start a new incarnation with empty memory; a running one of the same id is killed first.

        `number`: that of the incarnation; None: drawn from its host's clock, which may be set back. `mission`: what it
        holds in place of the team's.
        """
        if robot_id in self.processes and self.processes[robot_id].alive:
            self.kill(robot_id)
        self._incarnations += 1
        drawn = drawn_at(self.wall_ms.get(robot_id, 0), self._incarnations)
        member = Member(robot_id, drawn if number is None else number)
        clock = LocalClock(self.random.uniform(0.0, 1000.0), self.rates.get(robot_id, 1.0))
        floor = max(round(self.now * 1000.0) + self.wall_ms.get(robot_id, 0), 0)
        mission = mission or self.mission
        lease = Lease(
            member, mission, timing_for(mission), clock.local(self.now), floor, partial(self.observed, member)
        )
        process = Process(member, lease, clock, self.mission.robots)
        self.processes[robot_id] = process
        if self.trace is not None:
            self.trace(self.now, robot_id, f"starts, incarnation {member.incarnation}")
        self._report(Checker.lives, self.now, member)
        self._report(Checker.holds, self.now, member, digest(agreement_of(mission, timing_for(mission))))
        self.tell_token(member, up=True)
        if robot_id != WITNESS_ID:
            self.at(self.now + self.random.uniform(0.0, FOLLOW_PERIOD_S), self.follow, process)
            host = self.gateways.get(robot_id)
            if host is not None and host.alive:
                host.gateway.agent_up(member.incarnation, host.clock.local(self.now))
        self.wake_at(process, self.now)

    def carry_out(self, process: Process, effects: list[Effect]) -> None:
        """Execute the effects of a lease; start anew, under a later number, a process that was told of one (E23)."""
        super().carry_out(process, effects)
        newest = process.lease.superseded_by
        if newest is not None and process.alive and not process.leaving:
            self.start(process.id, after(newest, process.member.incarnation))

    def kill(self, robot_id: int, *, hinted: bool = True) -> None:
        """Kill the process (SIGKILL); with `hinted`, connected ones see its token vanish within 5 ms."""
        process = self.processes[robot_id]
        if not process.alive:
            return
        process.alive = False
        if self.trace is not None:
            self.trace(self.now, robot_id, "dies")
        self.tell_end(process)
        if hinted:
            self.tell_token(process.member, up=False)
            self.at(self.now + self.random.uniform(*HINT_DELAY_S), self.latch, robot_id, process.member.incarnation)

    def exit(self, robot_id: int) -> None:
        """Request the process to release its lease and exit (SIGTERM); a paused process ignores it."""
        process = self.processes[robot_id]
        if process.alive and not process.paused:
            process.leaving = True
            self.carry_out(process, process.lease.request_release(process.clock.local(self.now)))

    def hand_over(self, robot_id: int) -> None:
        """Request a hand-over of the lease from the process, unless it is paused."""
        process = self.processes[robot_id]
        if process.alive and not process.paused:
            self.carry_out(process, process.lease.request_handover(process.clock.local(self.now)))

    def forget(self, *lost: Member) -> None:
        """Deliver the operator's `forget` command for `lost` to every running robot, now."""
        for process in self.processes.values():
            if process.alive and process.id != WITNESS_ID:
                self.deliver(process, process.lease.request_forget, (lost,))

    def pause(self, robot_id: int) -> None:
        """Pause the process (SIGSTOP): incoming messages are kept, its clock goes on."""
        self.processes[robot_id].paused = True

    def resume(self, robot_id: int, shuffled: bool = False) -> None:
        """Resume the process (SIGCONT): send the command held back, then handle the kept messages."""
        process = self.processes[robot_id]
        if not process.paused:
            return
        process.paused = False
        if not process.alive:
            return
        if process.drawn is not None:
            self.command(robot_id, process.drawn)
        inbox, process.inbox = process.inbox, []
        if shuffled:
            self.random.shuffle(inbox)
        for method, arguments in inbox:
            self.take(process, method, arguments)
        self.wake_at(process, self.now)

    def hint(self, about: int, *observers: int, up: bool = False) -> None:
        """Deliver a liveliness event about `about` to `observers`, true or false."""
        member = self.processes[about].member
        for observer in observers:
            if self.processes[observer].alive:
                process = self.processes[observer]
                self._hinted(process, (member.id, member.incarnation, up))

    def step_wall(self, robot_id: int, by_s: float) -> None:
        """Set a host's wall clock wrong by `by_s` [s]; no other clock can be stepped."""
        self.wall_ms[robot_id] = round(by_s * 1000.0)
        self._report(Checker.wall_steps, self.now, robot_id)

    def command_ahead(self, robot_id: int, by_s: float) -> None:
        """Send a follower's command to a robot's gateway that echoes a time `by_s` [s] ahead of its clock (E12)."""
        process, stamp = self.processes[robot_id], self.stamp(robot_id)
        if stamp is not None:
            ahead = structs.replace(stamp, time=stamp.time + by_s)
            self.command(robot_id, self._drawn(process, process.lease.term, process.lease.chain[0], False, ahead))

    def lose_late(self, within_s: float) -> None:
        """Drop the messages in transit that would arrive later than `within_s` [s] from now."""
        self.lose(self.now + within_s, (self._arrive, self._at_gateway, self._commanded))

    def tell_healed(self) -> None:
        """Notify the checkers that the last fault is over."""
        self._report(Checker.heals, self.now, 4.0 * self.link_model.radio.prompt_s)

    # --- queries of tests --------------------------------------------------------------------------------------

    def leaders(self) -> list[int]:
        """Return the ids whose lease is valid now by their own clocks."""
        return [
            i for i, p in sorted(self.processes.items()) if p.alive and p.lease.may_command(p.clock.local(self.now))
        ]

    def lease_of(self, robot_id: int) -> Lease:
        """Return the lease of the newest incarnation of an id."""
        return self.processes[robot_id].lease
