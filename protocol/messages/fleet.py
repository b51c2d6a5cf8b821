"""Messages of the supervisors of a fleet of machines."""

from __future__ import annotations

from msgspec import Struct

from lfa.protocol.messages.header import Header


class ProcessReport(Struct, frozen=True, array_like=True, gc=False):
    """State of one process of a machine, reported by its supervisor."""

    name: str
    state: str
    """`running`, `waiting` (for a restart), `ended` (successfully, for good), `failed` (given up) or `refused`."""
    pid: int
    """Process id; 0 while it does not run."""
    starts: int
    began_ms: int
    """Wall clock [ms] of its machine at its last start; the incarnation in its messages is no earlier one (E23)."""
    up_s: float
    ended: str
    """Description of how its last incarnation ended; empty if none has."""


class HostStatus(Struct, frozen=True, array_like=True, tag="host"):
    """Processes of one machine of a fleet, published once a second and on each change."""

    header: Header
    host: str
    version: str
    run: str
    """Fleet file and time of `lfa up`; equal on all hosts of one fleet."""
    obeyed: tuple[int, int]
    """Incarnation and number of the last executed order: its acknowledgement."""
    processes: tuple[ProcessReport, ...]


class HostOrder(Struct, frozen=True, array_like=True, tag="order"):
    """Order of an operator to the supervisors, repeated until every addressed supervisor has executed it."""

    header: Header
    action: str
    """Action: `report`, `restart`, `logs` or `down`."""
    target: str
    """Addressed process (`robot3`, `a/router`) or host; empty: all."""
    lines: int = 0
    """Number of last lines that `logs` requests; later lines follow for a few seconds."""


class LogLines(Struct, frozen=True, array_like=True, tag="log"):
    """New lines of the log of one process."""

    header: Header
    name: str
    lines: tuple[str, ...]
