"""Faults of the links of a simulation: cuts, and link conditions that are worse for a while."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from msgspec import structs

from lfa.deploy.fuzz.partition import Pairs
from lfa.deploy.fuzz.schedules import LEADER, ScheduledFault
from lfa.protocol.names import WITNESS_ID
from lfa.protocol.transport.link_model import LinkModel, Radio

RADIO_FIELDS = {"loss": "loss", "burst": "loss", "duplicate": "duplication", "tail": "tail", "reorder": "reorder"}
"""Field of the link conditions that each kind of fault sets."""


class MortalProcess(Protocol):
    """Process of a simulation, which may have ended."""

    @property
    def alive(self) -> bool: ...


class FaultyTeam(Protocol):
    """Simulation with links between its hosts `ids`, and a process at each of them."""

    ids: tuple[int, ...]
    link_model: LinkModel

    @property
    def now(self) -> float: ...

    @property
    def processes(self) -> Mapping[int, MortalProcess]: ...

    def leaders(self) -> list[int]: ...

    def at(self, time: float, what: Callable[..., None], *arguments: Any) -> None: ...

    def part(self, pairs: Pairs) -> None: ...

    def heal_partition(self, pairs: Pairs) -> None: ...


def target_of(team: FaultyTeam, fault: ScheduledFault) -> int | None:
    """Return the id of the fault's target, or None if no such process is running."""
    target = fault.targets[0] if fault.targets else WITNESS_ID
    if target == LEADER:
        leaders = team.leaders()
        return leaders[0] if leaders else None
    process = team.processes.get(target)
    return target if process is not None and process.alive else None


class LinkFaults:
    """Injector of faults of the links, which return to `radio` unless something else holds by then."""

    def __init__(self, team: FaultyTeam, radio: Radio) -> None:
        self._team = team
        self._radio = radio

    def disturb(self, fault: ScheduledFault, target: int | None, until: float) -> bool:
        """Disturb the links until true time `until` [s]; return True if the fault took effect."""
        team = self._team
        match fault.kind:
            case "cut" | "cut_one_way" | "cut_pair":
                pairs = self._pairs(fault, target)
                team.part(pairs)
                team.at(until, team.heal_partition, pairs)
                return bool(pairs)
            case kind if kind in RADIO_FIELDS:
                field = RADIO_FIELDS[kind]
                team.link_model.radio = structs.replace(team.link_model.radio, **{field: fault.value})
                team.at(until, self._calm, field)
                return True
        return False

    def calm_all(self) -> Radio:
        """End what loses, doubles or delays messages, for good, and return the link conditions that are left."""
        model = self._team.link_model
        self._radio = model.radio = structs.replace(model.radio, loss=0.0, duplication=0.0, tail=0.0, reorder=0.0)
        return self._radio

    def _calm(self, field: str) -> None:
        model = self._team.link_model
        model.radio = structs.replace(model.radio, **{field: getattr(self._radio, field)})

    def _pairs(self, fault: ScheduledFault, target: int | None) -> set[tuple[int, int]]:
        ids = set(self._team.ids)
        if fault.kind == "cut_pair":
            other = fault.targets[1]
            return set() if target is None or target == other else {(target, other), (other, target)}
        side = {i for i in (target if i == LEADER else i for i in fault.targets) if i is not None} & ids
        there = {(a, b) for a in side for b in ids - side}
        return there if fault.kind == "cut_one_way" else there | {(b, a) for a, b in there}
