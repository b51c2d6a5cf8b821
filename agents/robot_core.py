"""One robot with its mission: it updates its state from an input, runs the lease, chooses a role, drives, publishes.

Messages of the lease act on arrival; control runs at its own fixed rate, and computes from what is known at that
moment. A robot that becomes leader commands at once.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import msgspec

from lfa.agents.attendance import Attendance
from lfa.agents.avoidance.safety import obeyed
from lfa.agents.chain_place import ChainPlace
from lfa.agents.command_publisher import CommandPublisher
from lfa.agents.input_watch import InputWatch, RefusalWatch
from lfa.agents.leading.formation_commands import FormationCommands
from lfa.agents.load.control_rate import ControlRate
from lfa.agents.navigator import Navigator
from lfa.agents.orders.roster_orders import JOIN, RETIRE, RosterOrders
from lfa.agents.orders.roster_orders import QUESTION as ROSTER
from lfa.agents.orders.stop_listener import StopListener
from lfa.agents.orders.team_orders import QUESTION, TeamOrders
from lfa.agents.stuck_policy import StuckPolicy
from lfa.agents.subscriptions import with_mission
from lfa.agents.team_messages import TeamMessage, TeamMessages
from lfa.agents.team_state import TeamState, report_s_max, sensors_s_max
from lfa.agents.telemetry import Reports
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import STILL
from lfa.protocol.lease.effects import AdoptChain, BecomeLeader, Effect, LeaseExtended, Send, StandAside, StepDown
from lfa.protocol.lease.machine.lease import Lease, Observer
from lfa.protocol.lease.timing import timing_for
from lfa.protocol.messages.consensus import LeaseNote, Member, Role, Term
from lfa.protocol.messages.orders import OrderNote
from lfa.protocol.messages.robot import GroundProfile, LaserScan, Localization, SensorReading, Sensors
from lfa.protocol.messages.stop import StopKnowledge, StopOrder, StopReport
from lfa.protocol.messages.team import Ask, FormationNote, ObstacleNote, OperatorNote, PoseStamped, TableRow
from lfa.protocol.mission import Mission
from lfa.protocol.mission_checks import check_mission
from lfa.protocol.names import robot_id_of
from lfa.protocol.node import PeerDown, PeerUp, Stop, Vitals
from lfa.protocol.outbox import Outbox
from lfa.protocol.topics import OPERATOR_NAME

EASE_PERIODS = 2.0
"""Lease time left, in control periods, beyond which a grant may wait for the next control step: each voter of a round
would wake the leader."""


class RobotCore:
    """One robot from its mission on. Its messages go to the `outbox`, which its agent drains after each call."""

    def __init__(
        self,
        robot_id: int,
        mission: Mission,
        outbox: Outbox,
        floor: int,
        now: float,
        observer: Observer | None,
        *,
        spare: bool = False,
    ) -> None:
        """Start with the mission. Raise `Refused` when it is invalid, or has no robot `robot_id` which is no `spare`.

        `observer` is told of every event of the lease.
        """
        check_mission(mission)
        if robot_id not in mission.robots and not spare:
            raise Refused(f"id {robot_id}: not in the mission, which has robots {list(mission.robots)}")
        self.defer_grants = self.defer_rounds = False
        self.refusal: str | None = None
        """What this robot's mission says otherwise than its team's (E25); None if nothing."""
        self.leaves = False
        """True once an exit was requested, or others know a later incarnation (E23)."""
        self._id = robot_id
        self._outbox = outbox
        self._team = TeamState(sensors_s_max(mission), report_s_max(len(mission.robots)))
        self.navigator = Navigator(robot_id, mission, self._team)
        me = Member(robot_id, outbox.incarnation)
        timing = timing_for(mission)
        self.lease = Lease(me, mission, timing, now, floor, observer)
        self._place = ChainPlace(robot_id, self.lease)
        self._stop_listener = StopListener(robot_id, mission.robots, outbox)
        self._commands = CommandPublisher(robot_id, outbox, self._team, self.lease, self._place, self._stop_listener)
        self._formation_commands = FormationCommands(outbox, mission, self.navigator.formation)
        self._team_messages = TeamMessages(robot_id, self.navigator, self._team, self._formation_commands, self._event)
        self._team_orders = TeamOrders(outbox, mission)
        self._roster_orders = RosterOrders(robot_id, mission, self.lease, outbox)
        self._reports = Reports(outbox, len(mission.robots), timing.deadman_s - mission.control_period_s)
        self._attendance = Attendance(robot_id, mission.robots)
        self._stuck_policy = StuckPolicy(robot_id, mission, outbox, self._team)
        self._input_watch = InputWatch(outbox, self.navigator, self.lease.grant_s)
        self._refusal_watch = RefusalWatch(outbox)
        self._control_rate = ControlRate(mission, timing.deadman_s)
        self._period_s = mission.control_period_s
        self._next_control = now
        self._arrived = False
        self._spec = mission.formation
        self._pending_release = False
        self._often: dict[type, Callable[[Any, float], object]] = {
            Sensors: self._hear_sensors,
            Localization: self.navigator.estimator.localization,
            LaserScan: self.navigator.see,
            GroundProfile: self.navigator.update_ground,
            SensorReading: self.navigator.own_readings.update,
            LeaseNote: self._hear_lease,
            **dict.fromkeys((PoseStamped, TableRow, ObstacleNote, FormationNote), self._hear_robot),
        }
        """What hears the messages of which there are hundreds a second: one look-up, where each `case` is a test."""
        self._asks = not self._stop_listener.memory.certain
        self.interests = with_mission(outbox.fleet, outbox.name, None, asks=self._asks)
        self._event("mission", now, {"version": mission.version, "robots": list(mission.robots)})

    @property
    def finished(self) -> bool:
        """True when a requested exit is complete: the final messages are out."""
        return self._pending_release and self.lease.released

    @property
    def stop_known(self) -> StopKnowledge:
        """What this robot knows of the fleet stop."""
        return self._stop_listener.known

    @property
    def lacks_messages(self) -> bool:
        """True while this robot has no leader, is in no chain, or does not hear what its team sends (E27)."""
        return self._attendance.lacks_messages

    @property
    def superseded_by(self) -> int | None:
        """Number of a later incarnation that others know (E23); None if there is none, or if the robot is leaving."""
        return None if self._pending_release else self.lease.superseded_by

    def next_deadline(self) -> float:
        """Return the time [s] of the next control step, or of the lease's deadline before it."""
        return min(self._next_control, self.lease.next_deadline(self._next_control))

    def tick(self, now: float) -> None:
        """Do what is due at `now` [s]: the lease's part, then a control step."""
        step = now >= self._next_control
        if step:
            self._next_control = _next_on_grid(self._next_control, now, self._period_s)
        if step or now >= self.lease.next_deadline():
            self._apply(self.lease.tick(now, self._next_control), now)
        if step:
            self._control(now)

    # --- inputs ---------------------------------------------------------------------------------------------------

    def receive(self, message: object, now: float) -> None:
        """Process a message or a local event."""
        self._often.get(type(message), self._receive_seldom)(message, now)

    def _hear_lease(self, note: LeaseNote, now: float) -> None:
        source = robot_id_of(note.header.sender)
        if source is not None:
            self._apply(self.lease.receive(Member(source, note.header.incarnation), note.body, now), now)
            self.leaves = self._pending_release or self.lease.superseded_by is not None

    def _hear_robot(self, message: TeamMessage, now: float) -> None:
        robot = robot_id_of(message.header.sender)
        if robot is not None and robot != self._id:
            self._team_messages.hear(robot, message, now)

    def _hear_sensors(self, sensors: Sensors, now: float) -> None:
        lease = self.lease
        if self._input_watch.fits(sensors, lease.term, now):
            self._team.hear_sensors(sensors, now)
            self._stop_listener.hear_sensors(sensors)
            self.navigator.estimator.sensors(sensors, now)
            self._apply(lease.gateway_term(sensors.term_max, now, sensors.latched), now)
            lease.learn_incarnation(sensors.agent)
            self.leaves = self._pending_release or lease.superseded_by is not None

    def _receive_seldom(self, message: object, now: float) -> None:
        """Process a message that is not in the table `_often`."""
        lease, navigator = self.lease, self.navigator
        match message:
            case PeerUp() | PeerDown():
                peer = robot_id_of(message.name)
                if peer is not None:
                    self._apply(lease.hint(peer, message.incarnation, isinstance(message, PeerUp), now), now)
            case OperatorNote():
                self._obey(message, now)
            case StopOrder() | StopReport() | Ask():
                self._stop_listener.receive(message, now)
                if isinstance(message, Ask) and lease.role is Role.LEADER:
                    self._answer(message.what, now)
            case OrderNote():
                self._take_order(message, now)
            case Vitals():
                self._fit_rates(message.loop_lag_s, now)
                self._attendance.update(lease, self._team, now)
                self._refusal_watch.update(message.refused, lease.term, now)
                stopped = self._stop_listener.text() if lease.chain else ""
                held = stopped or self._roster_orders.text() or self._attendance.text()
                held = held or self._refusal_watch.text(now)
                held = ", ".join(filter(None, (held, self._control_rate.text())))
                gateway = self._input_watch.text()
                self._reports.status(message, navigator, self._team, lease, self._role(), held, gateway, now)
            case Stop():
                self._stop(now)

    def _obey(self, note: OperatorNote, now: float) -> None:
        """Obey an operator's command. Only the leader changes the formation, or hands the lease to the next in the
        chain.
        """
        lease = self.lease
        if note.command == "forget":
            self._forget(note, now)
        if note.command in (JOIN, RETIRE):
            effects, hands_over = self._roster_orders.obey(note, now)
            self._apply(effects, now)
            if hands_over:
                self._hand_over(now)
        if note.command == "teleop":
            self.navigator.hand_driving.hear(note.arguments, now)
        side = str(note.arguments.get("side"))
        if lease.role is not Role.LEADER:
            if note.command == "formation":
                self._formation_commands.remember(side, now)
            return
        if note.command == "formation":
            self._formation_commands.order(side, "operator", lease.chain[1:], lease.term, now)
        elif note.command == "handover":
            self._hand_over(now)

    def _answer(self, what: str, now: float) -> None:
        """Answer an operator's question as leader."""
        if what == QUESTION:
            self._team_orders.say(self.lease.term, now)
        elif what == ROSTER:
            self._roster_orders.answer(now)

    def _take_order(self, note: OrderNote, now: float) -> None:
        """Process a change of the mission that an operator proposes, or that a leader carries (E32)."""
        lease, orders = self.lease, self._team_orders
        leads = lease.role is Role.LEADER
        if note.header.sender == OPERATOR_NAME:
            changed = orders.propose(note.order, leads, lease.term, now)
        elif leads:
            changed = orders.hear_robot(note, lease.term, now)
        else:
            changed = orders.hear(note, lease.config.version.term, now)
        if changed:
            self._change_mission(now)

    def _change_mission(self, now: float) -> None:
        orders, formation = self._team_orders, self._formation_commands
        side, separation_m = self._spec.side, self._spec.separation_m
        self._spec = orders.mission.formation
        if orders.order.route != self._team.route:
            self._arrived = False
        self.navigator.change(orders.mission, orders.order.route, now)
        formation.change(orders.mission)
        if self.lease.role is Role.LEADER and (side, separation_m) != (self._spec.side, self._spec.separation_m):
            formation.order(self._spec.side, "operator", self.lease.chain[1:], self.lease.term, now)

    def _forget(self, note: OperatorNote, now: float) -> None:
        """Exclude incarnations that are dead for good from the lease's next attempt (E20)."""
        try:
            lost = msgspec.convert(note.arguments.get("lives"), tuple[Member, ...])
        except msgspec.ValidationError:
            return
        self._event("forget", now, {"robots": [member.id for member in lost]})
        self._stop_listener.memory.forget(member.id for member in lost)
        self._apply(self.lease.request_forget(lost, now), now)

    def _stop(self, now: float) -> None:
        """Brake and release the lease; finished when the last messages are sent."""
        if not self._pending_release:
            self._pending_release = self.leaves = True
            self._commands.publish(STILL, now, as_leader=False)
            self._apply(self.lease.request_release(now), now)

    # --- the lease --------------------------------------------------------------------------------------------------

    def _apply(self, effects: list[Effect], now: float) -> None:
        """Carry out the effects of the lease in their order."""
        for effect in effects:
            match effect:
                case Send():
                    note = LeaseNote(self._outbox.header("lease", now), effect.body)
                    self._outbox.publish("lease", note, effect.receiver)
                case BecomeLeader(term, _):
                    self._event("lease", now, {"change": "acquired"}, term)
                    self._event("role", now, {"role": Role.LEADER.value, "leader": self._id}, term)
                    self._formation_commands.begin(now)
                    if self._team_orders.begin(term, now):
                        self._change_mission(now)
                    self._control(now)
                case StepDown(term, cause):
                    self.defer_grants = False
                    self._event("lease", now, {"change": cause}, term)
                case AdoptChain(config):
                    self._adopt(now)
                    chain = [member.id for member in config.chain]
                    self._stop_listener.memory.hear_chain(chain)
                    self._event("chain", now, {"chain": chain, "seq": config.version.seq}, config.version.term)
                case StandAside(reason):
                    self.refusal = reason
                case LeaseExtended():
                    pass

    def _adopt(self, now: float) -> None:
        """Follow the robot that the newest config puts ahead."""
        navigator = self.navigator
        ahead = self._place.ahead(stuck=navigator.stuck is not None)
        before = None if navigator.predecessor is None else navigator.predecessor.robot
        navigator.follow_robot(ahead, len(self._place.ids) - 1)
        if ahead != before:
            self._subscribe()
            role = Role.FOLLOWER if ahead is not None else Role.WAITING
            self._event("role", now, {"role": role.value, "predecessor": ahead}, self.lease.config.version.term)

    def _subscribe(self) -> None:
        ahead = None if self.navigator.predecessor is None else self.navigator.predecessor.robot
        self._asks = not self._stop_listener.memory.certain
        self.interests = with_mission(self._outbox.fleet, self._outbox.name, ahead, asks=self._asks)

    def _hand_over(self, now: float) -> None:
        self._commands.publish(STILL, now, as_leader=False)
        self._apply(self.lease.request_handover(now), now)

    # --- control ----------------------------------------------------------------------------------------------------

    def _control(self, now: float) -> None:
        """Run one control step: pose, role, command, then the reports."""
        lease, navigator = self.lease, self.navigator
        self.defer_grants = lease.is_settled(now + EASE_PERIODS * self._period_s)
        term = lease.term
        self._input_watch.step(term, now)
        self._stop_listener.step(now)
        if self._asks == self._stop_listener.memory.certain:
            self._subscribe()
        role = Role.WAITING if self._pending_release else self._role()
        self.defer_rounds = role is Role.FOLLOWER and not self._place.votes
        known = navigator.estimator.pose_at(now)
        if known is None:
            self._control_without_pose(role, now)
            return
        pose, twist = known
        paused = role is Role.LEADER and self._team_orders.order.paused
        paused = paused and not self.navigator.hand_driving.active(now)
        drives = Role.WAITING if paused or self._stop_listener.stands else role
        command = navigator.drive(drives, self._place.ids, pose, twist, now)
        self._commands.publish(command, now, as_leader=role is Role.LEADER)
        published = obeyed(navigator.last, twist)
        for kind, data in navigator.leading.drain():
            self._event(kind, now, data, term)
        self._reports.step(navigator, self._team, self._place.neighbours, role, term, pose, published, now)
        if self._stuck_policy.step(role, pose, lease, navigator, now):
            self._hand_over(now)
            return
        if role is Role.LEADER:
            self._team_orders.lead(lease.term, now)
            narrow = partial(navigator.narrow_ahead, pose)
            self._formation_commands.lead(navigator.leading.lead, self._place.ids[1:], lease.term, now, narrow)
        elif role is Role.FOLLOWER:
            self._team_orders.follow(lease.config.version.term, now)
        if role is Role.LEADER and not self._arrived and navigator.arrived(pose, command):
            self._arrived = True
            self._event("goal", now, {"x": round(pose.x, 4), "y": round(pose.y, 4)}, lease.term)

    def _fit_rates(self, lag_s: float, now: float) -> None:
        """Step less often, and publish fewer rows, while the machine keeps this robot late by `lag_s` [s] and more."""
        rate = self._control_rate
        if rate.update(lag_s, now):
            self._period_s, self._reports.table_s = 1.0 / rate.control_hz, rate.table_s
            self.navigator.pace(rate.control_hz)
            rates = {"control_hz": rate.control_hz, "table_hz": round(1.0 / rate.table_s, 3)}
            self._event("rate", now, {"late": rate.is_low, **rates})

    def _control_without_pose(self, role: Role, now: float) -> None:
        """Run one control step of a robot that has no pose: it brakes, and tells its team that it has none."""
        self._commands.publish(self.navigator.hold(now), now, as_leader=role is Role.LEADER)
        self._reports.step_without_pose(self.navigator, self._team, self._place.neighbours, role, now)
        if self._stuck_policy.step(role, None, self.lease, self.navigator, now):
            self._hand_over(now)

    def _role(self) -> Role:
        return self._place.role(follows=self.navigator.predecessor is not None)

    def _event(self, kind: str, now: float, data: dict[str, Any], term: Term | None = None) -> None:
        self._outbox.event(kind, now, self.lease.term if term is None else term, data)


def _next_on_grid(deadline: float, now: float, period: float) -> float:
    """Return the first point after `now` of the grid with step `period` through `deadline`."""
    return deadline + period * (int((now - deadline) / period) + 1)
