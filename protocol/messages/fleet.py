"""Messages of the supervisors of a fleet of machines."""

from __future__ import annotations

from msgspec import Struct

from lfa.protocol.messages.header import Header


class ProcessReport(Struct, frozen=True, array_like=True, gc=False):
    """One process of a machine, as its supervisor sees it."""

    name: str
    state: str
    """`running`, `waiting` (to be started again), `ended` (well, for good), `failed` (given up) or `refused`."""
    pid: int
    """0 while it does not run."""
    starts: int
    began_ms: int
    """Wall clock of its machine at its last start: the incarnation of what it says is no older."""
    up_s: float
    ended: str
    """How its last life ended, in words; empty when it never did."""


class HostStatus(Struct, frozen=True, array_like=True, tag="host"):
    """What runs on one machine of a fleet, once a second and on each change."""

    header: Header
    host: str
    version: str
    run: str
    """Which fleet file, brought up when: hosts of one fleet say the same."""
    obeyed: tuple[int, int]
    """Incarnation and number of the last order that was obeyed: its acknowledgement."""
    processes: tuple[ProcessReport, ...]


class HostOrder(Struct, frozen=True, array_like=True, tag="order"):
    """An operator's word to the supervisors; said again until all whom it concerns have obeyed."""

    header: Header
    deed: str
    """`report`, `restart`, `logs` or `down`."""
    target: str
    """A process (`robot3`, `a/router`), or a host; empty: all."""
    lines: int = 0
    """Of `logs`: how many of the last lines; later ones follow for a few seconds."""


class LogLines(Struct, frozen=True, array_like=True, tag="log"):
    """Lines of the log of one process, as they come."""

    header: Header
    name: str
    lines: tuple[str, ...]
