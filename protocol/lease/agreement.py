"""What safety rests on and all members must hold alike (E25): its digest, what differs, and who is the odd one."""

from __future__ import annotations

from zlib import crc32

import msgspec
from msgspec import structs

from lfa.protocol.lease.timing import CLOCK_RATE_ERROR, Timing
from lfa.protocol.messages.consensus import Agreement
from lfa.protocol.messages.header import AGREED_WIRE, WIRE_VERSION
from lfa.protocol.mission import Mission
from lfa.protocol.names import robot_name

GRACE_S = 3.0
"""Time [s] that a process without memory waits for those who hold the same before fewer others may outvote it."""
NAMES = (
    ("wire", "version of the messages"),
    ("version", "mission.version"),
    ("robots", "mission.robots"),
    ("witness", "mission.witness"),
    ("profile", "mission.profile"),
    ("act_s", "T_act [s]"),
    ("deadman_s", "D [s]"),
    ("clock_rate_error", "eps"),
    ("can_lead", "mission.can_lead"),
    ("tiebreak", "mission.tiebreak"),
    ("shrink", "mission.shrink"),
    ("cold_start", "mission.cold_start"),
    ("lonely", "mission.lonely"),
    ("continue_after_s", "mission.continue_after_s"),
)
"""Fields of `Agreement` with their names for people; a difference is told by the first that differs."""


def agreement_of(mission: Mission, timing: Timing) -> Agreement:
    """Return what a process with this mission and these durations holds."""
    return Agreement(
        WIRE_VERSION,
        mission.version,
        mission.robots,
        mission.witness,
        mission.profile,
        timing.act_s,
        timing.deadman_s,
        CLOCK_RATE_ERROR,
        mission.can_lead,
        mission.tiebreak,
        mission.shrink,
        mission.cold_start,
        mission.lonely,
        mission.continue_after_s,
    )


def digest(agreement: Agreement) -> int:
    """Return a number that differs, but for chance, where two agreements do; never 0, which is said by nobody.

    The version of the messages is no part of it, for two of them may meet (E35).
    """
    return crc32(msgspec.msgpack.encode(structs.replace(agreement, wire=AGREED_WIRE))) or 1


def understands(wire: int) -> bool:
    """Return True if messages of version `wire` and of this one may meet in one fleet: neighbours (E35)."""
    return abs(wire - WIRE_VERSION) <= 1


def difference(own: Agreement, other: Agreement) -> tuple[str, object, object] | None:
    """Return the name of the first field that differs, with its own and its other value."""
    for field, name in NAMES:
        mine, theirs = getattr(own, field), getattr(other, field)
        if mine != theirs and not (field == "wire" and understands(theirs)):
            return name, _plain(mine), _plain(theirs)
    return None


def _plain(value: object) -> object:
    return list(value) if isinstance(value, tuple) else value


class Census:
    """Which ids hold the same as this process and which hold something else, by what each said last."""

    def __init__(self, own: Agreement, robot_id: int, ids: tuple[int, ...], now: float) -> None:
        """Begin with this process alone; `ids` are all those of its mission."""
        self.own = own
        self._ids = ids
        self._alike = {robot_id}
        self._other: dict[int, Agreement] = {}
        self._grace_until = now + GRACE_S

    def alike(self, robot_id: int) -> None:
        """Record that this id holds the same."""
        self._alike.add(robot_id)
        self._other.pop(robot_id, None)

    def other(self, robot_id: int, agreement: Agreement) -> None:
        """Record that this id holds something else."""
        self._other[robot_id] = agreement
        self._alike.discard(robot_id)

    def outvoted(self, blank: bool, now: float) -> str | None:
        """Return in one line what this process holds otherwise than the team, None if it is not the odd one.

        It is if more than half of its mission's ids hold something else; and, after `GRACE_S` without memory, if more
        ids hold something else than the same.
        """
        others = len(self._other)
        few = 2 * others <= len(self._ids) and not (blank and now >= self._grace_until and others > len(self._alike))
        found = None if few else difference(self.own, self._other[min(self._other)])
        if found is None:
            return None
        name, mine, theirs = found
        names = ", ".join(robot_name(i) for i in sorted(self._other))
        return f"{name} = {mine}: must be {theirs}, which {names} hold"
