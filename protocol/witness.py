"""The witness: a voter without a robot. It breaks ties, so that exactly one half of a partitioned team can continue."""

from __future__ import annotations

import msgspec

from lfa.protocol.incarnations import after
from lfa.protocol.lease.effects import Effect, Send, StandAside
from lfa.protocol.lease.machine.lease import Lease, Observer
from lfa.protocol.lease.timing import timing_for
from lfa.protocol.messages.consensus import NO_TERM, LeaseNote, Member, Role
from lfa.protocol.messages.team import Ask, Level, MissionNote, Status
from lfa.protocol.mission import Mission
from lfa.protocol.names import WITNESS_ID, WITNESS_NAME, robot_id_of, robot_name
from lfa.protocol.node import Envelope, PeerDown, PeerUp, Received, Stop
from lfa.protocol.outbox import Outbox
from lfa.protocol.topics import TO_ALL, TO_HELLO, alive_key, key

ASK_S = 0.5
STATUS_S = 1.0


def heard_by_witness(fleet: str) -> frozenset[str]:
    """Return the key expressions that a witness subscribes to."""
    lease = {key(fleet, "*", "lease", to) for to in (TO_ALL, TO_HELLO, WITNESS_NAME)}
    return frozenset(lease | {key(fleet, "*", "mission"), alive_key(fleet, "*", "*")})


class Witness:
    """Node around a `Lease` with id 0. Without a mission it asks for one."""

    name = WITNESS_NAME
    defer_hellos = defer_grants = False

    def __init__(self, fleet: str, incarnation: int, floor: int, mission: Mission | None = None) -> None:
        self.incarnation = incarnation
        self.interests = heard_by_witness(fleet)
        self.finished = False
        self.refusal: str | None = None
        self.started_with = {"kind": "witness", "mission": msgspec.to_builtins(mission)}
        self.lease_observer: Observer | None = None
        """Told of every event of the lease; set before the mission is known."""
        self._fleet = fleet
        self._floor = floor
        self._mission = mission
        self._lease: Lease | None = None
        self._ask_at = float("-inf")
        self._status_at = float("-inf")
        self._outbox = Outbox(fleet, WITNESS_NAME, incarnation)

    @property
    def lease(self) -> Lease | None:
        """Lease of the witness; None before the mission."""
        return self._lease

    @property
    def lacks_messages(self) -> bool:
        """True while the witness has no mission, or knows of no leader (E27)."""
        return self._lease is None or self._lease.leader is None

    @property
    def reborn(self) -> Witness | None:
        """Return the witness under a later number, once it is told of a later incarnation of its name (E23)."""
        newest = None if self._lease is None else self._lease.superseded_by
        if newest is None or self.finished:
            return None
        return Witness(self._fleet, after(newest, self.incarnation), self._floor, self._mission)

    def receive(self, received: Received) -> list[Envelope]:
        now = received.at
        match received.message:
            case MissionNote(mission=mission) if self._mission is None:
                self._mission = mission
                return self._carry_out(self._lease_at(now, mission).tick(now), now)
            case LeaseNote(header=header, body=body) if self._lease is not None:
                sender = robot_id_of(header.sender)
                if sender is None:
                    return []
                return self._carry_out(self._lease.receive(Member(sender, header.incarnation), body, now), now)
            case PeerUp(name=name, incarnation=incarnation):
                return self._hint(name, incarnation, True, now)
            case PeerDown(name=name, incarnation=incarnation):
                return self._hint(name, incarnation, False, now)
            case Stop():
                return self._stop(now)
        return []

    def tick(self, now: float) -> list[Envelope]:
        if self._lease is None and self._mission is not None:
            self._lease_at(now, self._mission)
        envelopes: list[Envelope] = []
        if self._lease is None:
            if now >= self._ask_at:
                self._ask_at = now + ASK_S
                envelopes.append(self._outbox.envelope("ask", Ask(self._outbox.header("ask", now), "mission")))
        else:
            envelopes += self._carry_out(self._lease.tick(now), now)
        if now >= self._status_at:
            self._status_at = now + STATUS_S
            envelopes.append(self._outbox.envelope("status", self._status(now)))
        return envelopes

    def next_deadline(self) -> float:
        return min(self._status_at, self._ask_at if self._lease is None else self._lease.next_deadline())

    def _lease_at(self, now: float, mission: Mission) -> Lease:
        me = Member(WITNESS_ID, self.incarnation)
        self._lease = Lease(me, mission, timing_for(mission), now, self._floor, self.lease_observer)
        return self._lease

    def _hint(self, name: str, incarnation: int, up: bool, now: float) -> list[Envelope]:
        robot_id = robot_id_of(name)
        if self._lease is None or robot_id is None or robot_id == WITNESS_ID:
            return []
        return self._carry_out(self._lease.hint(robot_id, incarnation, up, now), now)

    def _stop(self, now: float) -> list[Envelope]:
        self.finished = True
        return [] if self._lease is None else self._carry_out(self._lease.request_release(now), now)

    def _carry_out(self, effects: list[Effect], now: float) -> list[Envelope]:
        envelopes: list[Envelope] = []
        for effect in effects:
            if isinstance(effect, Send):
                note = LeaseNote(self._outbox.header("lease", now), effect.body)
                envelopes.append(self._outbox.envelope("lease", note, effect.receiver))
            elif isinstance(effect, StandAside):
                self.refusal = effect.reason
        return envelopes

    def _status(self, now: float) -> Status:
        header = self._outbox.header("status", now)
        if self._lease is None:
            return Status(header, Level.WARN, "waiting for a mission", Role.WAITING, NO_TERM, {})
        text = "no leader" if self._lease.leader is None else f"robot{self._lease.leader} leads"
        if self._lease.missing:
            text = f"waiting for {', '.join(robot_name(i) for i in self._lease.missing)}"
        return Status(header, Level.OK, text, Role.WAITING, self._lease.term, {})
