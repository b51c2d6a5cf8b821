"""One event in, messages out: update what is known, run the lease, choose a role, drive, speak.

Messages of the lease act on arrival; control runs at its own fixed rate, and computes from what is known at that
moment. A robot that becomes leader commands at once.
"""

from __future__ import annotations

from math import pi
from typing import Any

import msgspec

from agents.beliefs import Beliefs
from agents.config import CONTROL_PERIOD_S
from agents.driver import Driver
from agents.formation import named, slots_of
from agents.voice import Voice
from protocol.geometry import STILL, Pose2D, Twist
from protocol.lease import AdoptChain, BecomeLeader, Effect, Lease, LeaseExtended, Send, StepDown
from protocol.messages import (
    Ask,
    CmdVel,
    Event,
    FormationNote,
    LaserScan,
    LeaseNote,
    Level,
    Localization,
    Member,
    MissionNote,
    OperatorNote,
    PoseStamped,
    Role,
    Sensors,
    Status,
    TableRow,
    Term,
    Tracking,
)
from protocol.mission import Mission, Refused, check_mission, robot_id_of, robot_name
from protocol.node import Envelope, PeerDown, PeerUp, Received, Stop, Vitals
from protocol.timing import timing_of
from protocol.topics import TOPIC, alive_key

ASK_S = 0.5
TABLE_ROBOTS_FULL_RATE = 16
TRACKING_EVERY = 2
FORMATION_S = 1.0
BEND_CHECK_S = 0.5
BEND_AHEAD_M = 5.0
"""Far enough ahead for a chain of four to fall into column at cruise speed."""


class Agent:
    """A Node: one life of one robot. `floor` starts its terms (wall-clock milliseconds at boot)."""

    def __init__(self, robot_id: int, incarnation: int, fleet: str, floor: int, mission: Mission | None = None) -> None:
        self._id = robot_id
        self._voice = Voice(fleet, robot_id, incarnation)
        self._floor = floor
        self._given = mission
        self._mission: Mission | None = None
        self._beliefs = Beliefs()
        self._lease: Lease | None = None
        self._driver: Driver | None = None
        self._next_ask = 0.0
        self._next_control = 0.0
        self._next_table = 0.0
        self._next_formation = 0.0
        self._formation_number = -1
        self._steps = 0
        self._oriented = 0
        self._next_bend_check = 0.0
        self._arrived = False
        self._detouring: str | None = None
        self._stopping = False
        self._vitals: Vitals | None = None
        self._out: list[Envelope] = []
        self._interests = self._wanted()
        self.refusal: str | None = None

    # --- what the shell sees ------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        return self._voice.name

    @property
    def incarnation(self) -> int:
        return self._voice.incarnation

    @property
    def started_with(self) -> dict[str, Any]:
        return {"kind": "agent", "robot_id": self._id, "mission": msgspec.to_builtins(self._given)}

    @property
    def interests(self) -> frozenset[str]:
        return self._interests

    @property
    def finished(self) -> bool:
        return self._stopping and (self._lease is None or self._lease.released)

    def next_deadline(self) -> float:
        if self._lease is None:
            return self._next_ask
        return min(self._next_control, self._lease.next_deadline())

    def tick(self, now: float) -> list[Envelope]:
        if self._lease is None:
            if self._given is not None:
                self._begin(self._given, now)
            elif now >= self._next_ask:
                self._next_ask = now + ASK_S
                self._say("ask", Ask(self._voice.header("ask", now), "mission"))
            return self._spoken()
        if now >= self._lease.next_deadline():
            self._apply(self._lease.tick(now), now)
        if now >= self._next_control:
            self._next_control = _next_on_grid(self._next_control, now, CONTROL_PERIOD_S)
            self._control(now)
        return self._spoken()

    def receive(self, received: Received) -> list[Envelope]:
        now, message = received.at, received.message
        match message:
            case MissionNote():
                if self._lease is None:
                    self._begin(message.mission, now)
            case Vitals():
                self._vitals = message
                self._status(now)
            case Stop():
                self._stop(now)
            case _ if self._lease is not None and self._driver is not None:
                self._hear(message, now, self._lease, self._driver)
        return self._spoken()

    # --- inputs ---------------------------------------------------------------------------------------------------

    def _hear(self, message: object, now: float, lease: Lease, driver: Driver) -> None:
        match message:
            case Sensors():
                self._beliefs.hear_sensors(message, now)
                driver.estimator.sensors(message, now)
                self._apply(lease.gateway_term(message.term_max, now, message.latched), now)
            case PoseStamped():
                robot = robot_id_of(message.header.sender)
                if driver.predecessor is not None and robot == driver.predecessor.robot:
                    driver.predecessor.heard(message, now)
            case LeaseNote():
                source = robot_id_of(message.header.sender)
                if source is not None:
                    self._apply(lease.receive(Member(source, message.header.incarnation), message.body, now), now)
            case Localization():
                driver.estimator.localization(message, now)
            case LaserScan():
                driver.see(message, now)
            case TableRow():
                self._hear_row(message, now, driver)
            case FormationNote():
                self._request(message, now, driver)
            case PeerUp() | PeerDown():
                peer = robot_id_of(message.name)
                if peer is not None:
                    up = isinstance(message, PeerUp)
                    self._apply(lease.hint(peer, message.incarnation, up, now), now)
            case OperatorNote():
                self._obey(message, now, lease, driver)

    def _hear_row(self, row: TableRow, now: float, driver: Driver) -> None:
        robot = robot_id_of(row.header.sender)
        if robot is None or robot == self._id:
            return
        self._beliefs.hear_row(robot, row, now)
        if driver.predecessor is not None and robot == driver.predecessor.robot:
            for delay in row.delays:
                if delay.robot == self._id:
                    driver.predecessor.clock.reported(delay.least_s, now)

    def _request(self, note: FormationNote, now: float, driver: Driver) -> None:
        if driver.formation.request(note):
            self._event("formation", now, {"number": note.number, "trace": note.trace})

    def _obey(self, note: OperatorNote, now: float, lease: Lease, driver: Driver) -> None:
        """An operator's word; only the leader changes the formation, or gives the lease to the next in the chain."""
        if lease.role is not Role.LEADER:
            return
        if note.command == "formation":
            self._order(str(note.arguments.get("side")), "operator", now, lease, driver)
        elif note.command == "handover":
            self._command(STILL, Role.FOLLOWER, now)
            self._apply(lease.request_handover(now), now)

    def _order(self, side: str, reason: str, now: float, lease: Lease, driver: Driver) -> None:
        """An orientation request to all behind this leader, with its term and the next number."""
        assert self._mission is not None
        try:
            spec = named(side, self._mission.formation)
        except Refused:
            return
        self._formation_number += 1
        header = self._voice.header("formation", now)
        slots = slots_of(spec, lease.chain[1:])
        note = FormationNote(header, lease.term, self._formation_number, slots, driver.formation.trace)
        if driver.formation.request(note):
            self._say("formation", note)
            self._next_formation = now + FORMATION_S
            self._event("formation", now, {"number": note.number, "side": side, "by": reason}, note.term)

    # --- beginning and ending ---------------------------------------------------------------------------------------

    def _begin(self, mission: Mission, now: float) -> None:
        """The mission is known: from here on this robot votes, follows and may lead."""
        try:
            check_mission(mission)
            if self._id not in mission.robots:
                raise Refused(f"id {self._id}: not in the mission, which has robots {list(mission.robots)}")
            self._driver = Driver(self._id, mission, self._beliefs)
        except Refused as refused:
            self.refusal = str(refused)
            return
        self._mission = mission
        me = Member(self._id, self.incarnation)
        self._lease = Lease(me, mission, timing_of(mission.profile), now, self._floor)
        self._next_control = now
        self._interests = self._wanted()
        self._event("mission", now, {"version": mission.version, "robots": list(mission.robots)})

    def _stop(self, now: float) -> None:
        """Brake, give the lease back, and be done when its last words are out."""
        if self._stopping:
            return
        self._stopping = True
        if self._lease is not None:
            self._command(STILL, Role.FOLLOWER, now)
            self._apply(self._lease.request_release(now), now)

    # --- the lease --------------------------------------------------------------------------------------------------

    def _apply(self, effects: list[Effect], now: float) -> None:
        for effect in effects:
            match effect:
                case Send(to, body):
                    note = LeaseNote(self._voice.header("lease", now), body)
                    self._out.append(Envelope(self._voice.key("lease", to), note))
                case BecomeLeader(term, _):
                    self._event("lease", now, {"change": "acquired"}, term)
                    self._event("role", now, {"role": Role.LEADER.value, "leader": self._id}, term)
                    self._lead_on(now)
                    self._control(now)
                case StepDown(term, cause):
                    self._event("lease", now, {"change": cause}, term)
                case AdoptChain(config):
                    self._adopt(now)
                    chain = [member.id for member in config.chain]
                    self._event("chain", now, {"chain": chain, "seq": config.version.seq}, config.version.term)
                case LeaseExtended():
                    pass

    def _lead_on(self, now: float) -> None:
        """A reign begins: its requests count from 0, and what the route asked for so far has been asked for."""
        assert self._driver is not None and self._mission is not None
        self._formation_number, self._next_formation = 0, now
        progress_m = self._driver.lead.progress_m
        self._oriented = sum(orientation.at_m <= progress_m for orientation in self._mission.leading.orientations)

    def _adopt(self, now: float) -> None:
        """Follow whoever the newest config puts ahead."""
        assert self._lease is not None and self._driver is not None
        chain = self._lease.chain
        place = chain.index(self._id) if self._id in chain else 0
        ahead = chain[place - 1] if place > 0 else None
        before = self._driver.predecessor
        self._driver.follow_robot(ahead, len(chain) - 1)
        if (before.robot if before is not None else None) != ahead:
            self._interests = self._wanted()
            role = Role.FOLLOWER if place > 0 else Role.WAITING
            self._event("role", now, {"role": role.value, "predecessor": ahead}, self._lease.config.version.term)

    # --- control ----------------------------------------------------------------------------------------------------

    def _control(self, now: float) -> None:
        """One control step: where am I, what am I, where to, and say it."""
        assert self._lease is not None and self._driver is not None
        lease, driver = self._lease, self._driver
        known = driver.estimator.pose_at(now)
        if known is None:
            return
        pose, twist = known
        role = self._role(lease)
        if self._stopping:
            role = Role.WAITING
        command = driver.drive(role, lease.chain, pose, twist, now)
        self._command(command, role, now)
        self._speak(role, pose, twist, now)
        if role is Role.LEADER:
            self._orient(now, lease, driver)
        self._tell_decision(now)
        if role is Role.LEADER and not self._arrived and driver.arrived(pose, command):
            self._arrived = True
            self._event("goal", now, {"x": round(pose.x, 4), "y": round(pose.y, 4)}, lease.term)

    def _orient(self, now: float, lease: Lease, driver: Driver) -> None:
        """The mission's changes of formation as the route comes to them; column before a bend too tight for others."""
        assert self._mission is not None
        orientations = self._mission.leading.orientations
        progress_m = driver.lead.progress_m
        while self._oriented < len(orientations) and orientations[self._oriented].at_m <= progress_m:
            self._order(orientations[self._oriented].side, "mission", now, lease, driver)
            self._oriented += 1
        if now >= self._next_bend_check:
            self._next_bend_check = now + BEND_CHECK_S
            slots = [driver.formation.slot_of(robot) for robot in lease.chain[1:]]
            column = all(abs(abs(slot.phi) - pi) < 1e-6 for slot in slots)
            ahead_m = None if column or driver.formation.trace else driver.lead.narrow_bend_m(slots, BEND_AHEAD_M)
            if ahead_m is not None:
                self._order("column", f"bend in {ahead_m:.1f} m", now, lease, driver)

    def _role(self, lease: Lease) -> Role:
        if lease.role is Role.LEADER:
            return Role.LEADER
        in_chain = self._id in lease.chain and lease.chain.index(self._id) > 0
        return Role.FOLLOWER if in_chain and self._driver is not None and self._driver.predecessor else Role.WAITING

    def _command(self, twist: Twist, role: Role, now: float) -> None:
        """The gateway's stamp is read before the lease is checked (lease.md section 5): no stamp, no command."""
        sensors = self._beliefs.fresh_sensors(now)
        if sensors is None or self._lease is None:
            return
        as_leader = role is Role.LEADER
        if as_leader:
            if not self._lease.may_command(now):
                return
            self._lease.commanded(now)
        term = self._lease.term if as_leader else self._lease.config.version.term
        holder = self._id if as_leader else (self._lease.chain[0] if self._lease.chain else 0)
        header = self._voice.header("cmd_vel", now)
        self._say("cmd_vel", CmdVel(header, twist, term, holder, as_leader, sensors.gateway))

    # --- speech -----------------------------------------------------------------------------------------------------

    def _speak(self, role: Role, pose: Pose2D, twist: Twist, now: float) -> None:
        assert self._driver is not None and self._lease is not None
        voice, odometer = self._voice, self._driver.estimator.odometer_m
        self._say("pose", PoseStamped(
            voice.header("pose", now), pose.x, pose.y, 0.0, pose.theta, twist, odometer, role, self._lease.term
        ))  # fmt: skip
        self._steps += 1
        if role is Role.FOLLOWER and self._steps % TRACKING_EVERY == 0:
            self._tell_tracking(now)
        if now >= self._next_table:
            self._next_table = now + self._table_period_s()
            delays = self._beliefs.delays(self._neighbours(), now)
            row = TableRow(voice.header("table", now), pose.x, pose.y, 0.0, pose.theta, odometer, role, delays)
            self._say("table", row)
        if role is Role.LEADER and now >= self._next_formation:
            self._next_formation = now + FORMATION_S
            formation = self._driver.formation
            slots = tuple(formation.slot_of(robot) for robot in self._lease.chain[1:])
            header = voice.header("formation", now)
            note = FormationNote(header, self._lease.term, self._formation_number, slots, formation.trace)
            formation.request(note)
            self._say("formation", note)

    def _tell_tracking(self, now: float) -> None:
        assert self._driver is not None
        driver = self._driver
        if driver.predecessor is None:
            return
        r = driver.follower.readout
        self._say("tracking", Tracking(
            self._voice.header("tracking", now), driver.predecessor.robot, r.separation_m, r.phi, r.chi, r.heading,
            r.slot_map, r.error_m, driver.decision is not None, r.state.value,
        ))  # fmt: skip

    def _tell_decision(self, now: float) -> None:
        assert self._driver is not None
        decision = self._driver.decision
        action = None if decision is None else decision.action
        if action != self._detouring:
            self._detouring = action
            if decision is None:
                self._event("decision", now, {"class": "obstacle", "action": "resume"})
            else:
                free_m, direction = round(min(decision.free_m, 99.0), 3), round(decision.bearing, 3)
                data = {"class": "obstacle", "action": action, "free_m": free_m, "bearing_rad": direction}
                self._event("decision", now, data)

    def _status(self, now: float) -> None:
        vitals, lease, driver = self._vitals, self._lease, self._driver
        if vitals is None:
            return
        counters: dict[str, float] = {
            "loop_lag_ms": round(1000.0 * vitals.loop_lag_s, 3),
            "dropped": vitals.dropped,
            "undecodable": vitals.undecodable,
            "cpu_percent": round(vitals.cpu_percent, 2),
            "rss_mib": round(vitals.rss_mib, 1),
        }
        text, role, level = "waiting for the mission", Role.WAITING, Level.WARN
        term = Term()
        if lease is not None and driver is not None:
            role, term = self._role(lease), lease.term
            ready = driver.estimator.ready
            text, level = (role.value, Level.OK) if ready else ("waiting for sensors", Level.WARN)
            counters |= {"outliers": driver.estimator.outliers, "refused": driver.estimator.refused}
            if driver.predecessor is not None:
                counters["predecessor_clock_offset_s"] = driver.predecessor.clock.offset(now)
                counters["predecessor_refused"] = driver.predecessor.refused
        self._say("status", Status(self._voice.header("status", now), level, text, role, term, counters))

    def _event(self, kind: str, now: float, data: dict[str, Any], term: Term | None = None) -> None:
        if term is None and self._lease is not None:
            term = self._lease.term
        self._say("event", Event(self._voice.header("event", now), kind, term, data))

    def _say(self, topic: str, message: Any) -> None:
        self._out.append(Envelope(self._voice.key(topic), message))

    def _spoken(self) -> list[Envelope]:
        out, self._out = self._out, []
        return out

    # --- whom it hears ------------------------------------------------------------------------------------------------

    def _wanted(self) -> frozenset[str]:
        fleet, own = self._voice.fleet, self._voice.name
        common = {f"lfa/{fleet}/*/mission", f"lfa/{fleet}/*/operator"}
        if self._lease is None or self._driver is None:
            return frozenset(common)
        others = {f"lfa/{fleet}/*/{topic}" for topic in ("table", "formation")}
        lease = {f"lfa/{fleet}/*/lease/all", f"lfa/{fleet}/*/lease/{own}", alive_key(fleet, "*", "*")}
        hardware = {self._voice.key(topic) for topic in ("sensors", "localization", "scan")}
        ahead = self._driver.predecessor
        pose = set() if ahead is None else {f"lfa/{fleet}/{robot_name(ahead.robot)}/{TOPIC['pose'].name}"}
        return frozenset(common | others | lease | hardware | pose)

    def _neighbours(self) -> tuple[int, ...]:
        assert self._lease is not None
        chain = self._lease.chain
        if self._id not in chain:
            return ()
        place = chain.index(self._id)
        return chain[max(0, place - 1) : place] + chain[place + 1 : place + 2]

    def _table_period_s(self) -> float:
        assert self._mission is not None
        return max(0.5, len(self._mission.robots) * 0.5 / TABLE_ROBOTS_FULL_RATE)


def _next_on_grid(deadline: float, now: float, period: float) -> float:
    """The first point of the grid through `deadline` that lies after `now`."""
    return deadline + period * (int((now - deadline) / period) + 1)
