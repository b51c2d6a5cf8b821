"""One agent: it updates its state from one event, runs the lease, chooses a role, drives and publishes.

Messages of the lease act on arrival; control runs at its own fixed rate, and computes from what is known at that
moment. A robot that becomes leader commands at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec

from lfa.agents.config import CONTROL_PERIOD_S
from lfa.agents.leading.formation_commands import FormationCommands
from lfa.agents.navigator import Navigator
from lfa.agents.stuck_policy import StuckPolicy
from lfa.agents.team_state import SENSORS_S_MAX, TeamState
from lfa.agents.telemetry import Reports, status
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import STILL, Twist
from lfa.protocol.lease.effects import AdoptChain, BecomeLeader, Effect, LeaseExtended, Send, StepDown
from lfa.protocol.lease.machine.lease import Lease, Observer
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import NO_TERM, Config, LeaseNote, Member, Role, Term
from lfa.protocol.messages.robot import CmdVel, GroundProfile, LaserScan, Localization, Sensors
from lfa.protocol.messages.team import (
    Ask,
    FormationNote,
    MissionNote,
    ObstacleNote,
    OperatorNote,
    PoseStamped,
    TableRow,
)
from lfa.protocol.mission import Mission
from lfa.protocol.mission_checks import check_mission
from lfa.protocol.names import robot_id_of, robot_name
from lfa.protocol.node import Envelope, PeerDown, PeerUp, Received, Stop, Vitals
from lfa.protocol.outbox import Outbox
from lfa.protocol.topics import TOPIC, alive_key

if TYPE_CHECKING:
    from lfa.agents.exploration.occupancy_grid import Grid

ASK_S = 0.5
EASE_S = 2.0 * CONTROL_PERIOD_S
"""Lease time [s] left beyond which a grant may wait for the next control step: each voter of a round would wake the
leader."""


class Agent:
    """Node of one incarnation of one robot. `floor` starts its terms (wall-clock milliseconds at boot)."""

    def __init__(self, robot_id: int, incarnation: int, fleet: str, floor: int, mission: Mission | None = None) -> None:
        self._id = robot_id
        self._outbox = Outbox(fleet, robot_id, incarnation)
        self._floor = floor
        self._given = mission
        self._mission: Mission | None = None
        self._team = TeamState()
        self._lease: Lease | None = None
        self._config: Config | None = None
        self._chain_ids: tuple[int, ...] = ()
        self._driver: Navigator | None = None
        self._orders: FormationCommands | None = None
        self._reports: Reports | None = None
        self._stuck_policy: StuckPolicy | None = None
        self._next_ask = 0.0
        self._next_control = 0.0
        self._arrived = False
        self._lost_input: str | None = None
        self._pending_release = False
        self.defer_grants = False
        """True while grants can wait for the next control step: the lease lasts well beyond it."""
        self._interests = self._wanted()
        self.refusal: str | None = None
        self.lease_observer: Observer | None = None
        """Told of every event of the lease; set before the mission is known."""

    # --- interface to the node runner -----------------------------------------------------------------------------

    @property
    def name(self) -> str:
        return self._outbox.name

    @property
    def incarnation(self) -> int:
        return self._outbox.incarnation

    @property
    def started_with(self) -> dict[str, Any]:
        return {"kind": "agent", "robot_id": self._id, "mission": msgspec.to_builtins(self._given)}

    @property
    def interests(self) -> frozenset[str]:
        return self._interests

    @property
    def lease(self) -> Lease | None:
        """Lease of this robot, with the config that it knows; None before the mission."""
        return self._lease

    @property
    def grid(self) -> Grid | None:
        """Occupancy grid of an explorer, as far as mapped; None for other robots."""
        explore = None if self._driver is None else self._driver.explore
        return None if explore is None or explore.mapping is None else explore.mapping.grid

    @property
    def finished(self) -> bool:
        return self._pending_release and (self._lease is None or self._lease.released)

    def next_deadline(self) -> float:
        if self._lease is None:
            return self._next_ask
        return min(self._next_control, self._lease.next_deadline(self._next_control))

    def tick(self, now: float) -> list[Envelope]:
        if self._lease is None:
            if self._given is not None:
                self._begin(self._given, now)
            elif now >= self._next_ask:
                self._next_ask = now + ASK_S
                self._outbox.publish("ask", Ask(self._outbox.header("ask", now), "mission"))
            return self._outbox.drain()
        step = now >= self._next_control
        if step:
            self._next_control = _next_on_grid(self._next_control, now, CONTROL_PERIOD_S)
        if step or now >= self._lease.next_deadline():
            self._apply(self._lease.tick(now, self._next_control), now)
        if step:
            self._control(now)
        return self._outbox.drain()

    def receive(self, received: Received) -> list[Envelope]:
        now, message = received.at, received.message
        match message:
            case MissionNote():
                if self._lease is None:
                    self._begin(message.mission, now)
            case Vitals():
                lease = self._lease
                role, term = (Role.WAITING, NO_TERM) if lease is None else (self._role(lease), lease.term)
                missing = () if lease is None else lease.missing
                version = None if lease is None else lease.config.version
                status(self._outbox, message, self._team, self._driver, missing, role, term, version, now)
            case Stop():
                self._stop(now)
            case _ if self._lease is not None and self._driver is not None:
                self._hear(message, now, self._lease, self._driver)
        return self._outbox.drain()

    # --- inputs ---------------------------------------------------------------------------------------------------

    def _hear(self, message: object, now: float, lease: Lease, driver: Navigator) -> None:
        match message:
            case Sensors():
                self._team.hear_sensors(message, now)
                driver.estimator.sensors(message, now)
                self._apply(lease.gateway_term(message.term_max, now, message.latched), now)
            case Localization():
                driver.estimator.localization(message, now)
            case LaserScan():
                driver.see(message, now)
            case GroundProfile():
                driver.update_ground(message, now)
            case LeaseNote():
                source = robot_id_of(message.header.sender)
                if source is not None:
                    self._apply(lease.receive(Member(source, message.header.incarnation), message.body, now), now)
            case PoseStamped() | TableRow() | ObstacleNote() | FormationNote():
                robot = robot_id_of(message.header.sender)
                if robot is not None and robot != self._id:
                    self._hear_robot(robot, message, now, driver)
            case PeerUp() | PeerDown():
                peer = robot_id_of(message.name)
                if peer is not None:
                    up = isinstance(message, PeerUp)
                    self._apply(lease.hint(peer, message.incarnation, up, now), now)
            case OperatorNote():
                self._obey(message, now, lease)

    def _hear_robot(
        self, robot: int, message: PoseStamped | TableRow | ObstacleNote | FormationNote, now: float, driver: Navigator
    ) -> None:
        """Update the state from a message of another robot."""
        ahead = driver.predecessor if driver.predecessor is not None and driver.predecessor.robot == robot else None
        match message:
            case PoseStamped():
                if ahead is not None:
                    ahead.heard(message, now)
            case TableRow():
                self._team.hear_row(robot, message, now)
                least_s = next((delay.least_s for delay in message.delays if delay.robot == self._id), None)
                if ahead is not None and least_s is not None:
                    ahead.clock.reported(least_s, now)
            case ObstacleNote(kind="trap"):
                driver.avoid_trap(message, now)
            case ObstacleNote():
                self._team.obstacles.update(robot, message, now)
            case FormationNote():
                if driver.formation.request(message):
                    self._event("formation", now, {"number": message.number, "trace": message.trace})

    def _obey(self, note: OperatorNote, now: float, lease: Lease) -> None:
        """Obey an operator's command. Only the leader changes the formation, or hands the lease to the next in the
        chain.
        """
        if note.command == "forget":
            self._forget(note, now, lease)
        if lease.role is not Role.LEADER:
            return
        if note.command == "formation":
            assert self._orders is not None
            self._orders.order(str(note.arguments.get("side")), "operator", lease.chain[1:], lease.term, now)
        elif note.command == "handover":
            self._hand_over(lease, now)

    def _forget(self, note: OperatorNote, now: float, lease: Lease) -> None:
        """Exclude incarnations that are dead for good from the lease's next attempt (E20)."""
        try:
            lost = msgspec.convert(note.arguments.get("lives"), tuple[Member, ...])
        except msgspec.ValidationError:
            return
        self._event("forget", now, {"robots": [member.id for member in lost]})
        self._apply(lease.request_forget(lost, now), now)

    # --- start and stop ---------------------------------------------------------------------------------------------

    def _begin(self, mission: Mission, now: float) -> None:
        """Start with the mission: from here on this robot votes, follows and may lead."""
        try:
            check_mission(mission)
            if self._id not in mission.robots:
                raise Refused(f"id {self._id}: not in the mission, which has robots {list(mission.robots)}")
            self._driver = Navigator(self._id, mission, self._team)
        except Refused as refused:
            self.refusal = str(refused)
            return
        self._mission = mission
        self._orders = FormationCommands(self._outbox, mission, self._driver.formation)
        self._reports = Reports(self._outbox, len(mission.robots))
        self._stuck_policy = StuckPolicy(self._id, mission, self._outbox, self._team)
        me = Member(self._id, self.incarnation)
        self._lease = Lease(me, mission, timing_of(mission.profile), now, self._floor, self.lease_observer)
        self._next_control = now
        self._interests = self._wanted()
        self._event("mission", now, {"version": mission.version, "robots": list(mission.robots)})

    def _stop(self, now: float) -> None:
        """Brake and release the lease; finished when the last messages are sent."""
        if self._pending_release:
            return
        self._pending_release = True
        if self._lease is not None:
            self._command(STILL, Role.FOLLOWER, now)
            self._apply(self._lease.request_release(now), now)

    # --- the lease --------------------------------------------------------------------------------------------------

    def _apply(self, effects: list[Effect], now: float) -> None:
        for effect in effects:
            match effect:
                case Send(to, body):
                    self._outbox.publish("lease", LeaseNote(self._outbox.header("lease", now), body), to)
                case BecomeLeader(term, _):
                    self._event("lease", now, {"change": "acquired"}, term)
                    self._event("role", now, {"role": Role.LEADER.value, "leader": self._id}, term)
                    assert self._orders is not None
                    self._orders.begin(now)
                    self._control(now)
                case StepDown(term, cause):
                    self.defer_grants = False
                    self._event("lease", now, {"change": cause}, term)
                case AdoptChain(config):
                    self._adopt(now)
                    chain = [member.id for member in config.chain]
                    self._event("chain", now, {"chain": chain, "seq": config.version.seq}, config.version.term)
                case LeaseExtended():
                    pass

    def _adopt(self, now: float) -> None:
        """Follow the robot that the newest config puts ahead."""
        assert self._lease is not None and self._driver is not None
        chain = self._chain(self._lease)
        place = chain.index(self._id) if self._id in chain else 0
        ahead = chain[place - 1] if place > 0 else None
        if self._id not in chain and chain and self._driver.stuck is not None:
            ahead = chain[-1]  # E22: the chain was closed over this robot; it tries to come behind the last one
        before = self._driver.predecessor
        self._driver.follow_robot(ahead, len(chain) - 1)
        if (before.robot if before is not None else None) != ahead:
            self._interests = self._wanted()
            role = Role.FOLLOWER if ahead is not None else Role.WAITING
            self._event("role", now, {"role": role.value, "predecessor": ahead}, self._lease.config.version.term)

    # --- control ----------------------------------------------------------------------------------------------------

    def _control(self, now: float) -> None:
        """Run one control step: pose, role, command, then the reports."""
        assert self._lease is not None and self._driver is not None
        assert self._reports is not None and self._orders is not None and self._stuck_policy is not None
        lease, driver = self._lease, self._driver
        self.defer_grants = lease.may_command(now + EASE_S) and lease.config.previous is None
        known = driver.estimator.pose_at(now)
        if known is None:
            return
        pose, twist = known
        role = self._role(lease)
        if self._pending_release:
            role = Role.WAITING
        command = driver.drive(role, self._chain(lease), pose, twist, now)
        self._command(command, role, now)
        self._watch_inputs(driver, now)
        told = STILL if driver.estimator.age_s(now) > SENSORS_S_MAX else driver.published(twist)
        self._reports.place(driver, self._team, self._neighbours(), role, lease.term, pose, told, now)
        self._reports.decision(driver.decision, lease.term, now)
        self._reports.obstacle(driver, pose, now)
        if role is Role.LEADER and driver.explore is not None:
            self._reports.plan(driver.explore, pose, now)
        if self._stuck_policy.step(role, pose, lease, driver, now):
            self._hand_over(lease, now)
            return
        if role is Role.LEADER:
            self._orders.lead(driver.lead, self._chain(lease)[1:], lease.term, now)
        if role is Role.LEADER and not self._arrived and driver.arrived(pose, command):
            self._arrived = True
            self._event("goal", now, {"x": round(pose.x, 4), "y": round(pose.y, 4)}, lease.term)

    def _watch_inputs(self, driver: Navigator, now: float) -> None:
        """Publish an event when an input of the robot's own hardware is lost, and when it is back."""
        lost = driver.lost_input(now)
        if lost != self._lost_input:
            self._lost_input = lost
            data = {"state": "back"} if lost is None else {"state": "lost", "input": lost}
            self._event("input", now, data)

    def _hand_over(self, lease: Lease, now: float) -> None:
        self._command(STILL, Role.FOLLOWER, now)
        self._apply(lease.request_handover(now), now)

    def _role(self, lease: Lease) -> Role:
        if lease.role is Role.LEADER:
            return Role.LEADER
        follows = self._driver is not None and self._driver.predecessor is not None
        return Role.FOLLOWER if follows and self._id != (self._chain(lease) or (0,))[0] else Role.WAITING

    def _chain(self, lease: Lease) -> tuple[int, ...]:
        """Return the ids of the lease's chain, computed anew only when the config has changed (called many times a
        step).
        """
        if lease.config is not self._config:
            self._config, self._chain_ids = lease.config, lease.chain
        return self._chain_ids

    def _command(self, twist: Twist, role: Role, now: float) -> None:
        """Publish a command. The gateway's stamp is read before the lease is checked (lease.md section 5): no stamp, no
        command.
        """
        sensors = self._team.fresh_sensors(now)
        if sensors is None or self._lease is None:
            return
        as_leader = role is Role.LEADER
        if as_leader:
            if not self._lease.may_command(now):
                return
            self._lease.commanded(now)
        term = self._lease.term if as_leader else self._lease.config.version.term
        holder = self._id if as_leader else (self._chain(self._lease) or (0,))[0]
        header = self._outbox.header("cmd_vel", now)
        self._outbox.publish("cmd_vel", CmdVel(header, twist, term, holder, as_leader, sensors.gateway))

    def _event(self, kind: str, now: float, data: dict[str, Any], term: Term | None = None) -> None:
        if term is None and self._lease is not None:
            term = self._lease.term
        self._outbox.event(kind, now, term, data)

    # --- subscriptions ------------------------------------------------------------------------------------------------

    def _wanted(self) -> frozenset[str]:
        fleet, own = self._outbox.fleet, self._outbox.name
        common = {f"lfa/{fleet}/*/mission", f"lfa/{fleet}/*/operator"}
        if self._lease is None or self._driver is None:
            return frozenset(common)
        others = {f"lfa/{fleet}/*/{topic}" for topic in ("table", "formation", "obstacles")}
        lease = {f"lfa/{fleet}/*/lease/all", f"lfa/{fleet}/*/lease/{own}", alive_key(fleet, "*", "*")}
        hardware = {self._outbox.key(topic) for topic in ("sensors", "localization", "scan", "ground")}
        ahead = self._driver.predecessor
        pose = set() if ahead is None else {f"lfa/{fleet}/{robot_name(ahead.robot)}/{TOPIC['pose'].name}"}
        return frozenset(common | others | lease | hardware | pose)

    def _neighbours(self) -> tuple[int, ...]:
        assert self._lease is not None
        chain = self._chain(self._lease)
        if self._id not in chain:
            return ()
        place = chain.index(self._id)
        return chain[max(0, place - 1) : place] + chain[place + 1 : place + 2]


def _next_on_grid(deadline: float, now: float, period: float) -> float:
    """Return the first point after `now` of the grid with step `period` through `deadline`."""
    return deadline + period * (int((now - deadline) / period) + 1)
