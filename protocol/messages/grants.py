"""What a lockstep run grants to a process, and what that answers: on a private link, and no message of the fleet."""

from __future__ import annotations

from typing import Any

from msgspec import Struct

HELLO = 0
"""Number of the answer with which a process says that it is there, before its first grant."""


class GrantedCall(Struct, frozen=True, array_like=True, gc=False):
    """One call of a node at `at` [s]: a message (`key`, `payload`), a local event (no key), or a tick (neither)."""

    at: float
    key: str = ""
    payload: bytes = b""


class TimeGrant(Struct, frozen=True, array_like=True):
    """Calls to execute in this order, numbered from 1; without calls the run is over."""

    number: int
    calls: tuple[GrantedCall, ...]


class NodeState(Struct, frozen=True, array_like=True):
    """Properties of a node that change seldom; `started_with` is empty but in a hello."""

    interests: tuple[str, ...]
    finished: bool
    refusal: str | None
    started_with: dict[str, Any] = {}


class CallResult(Struct, frozen=True, array_like=True):
    """Result of one call: what it publishes, the next deadline [s], and the state if it differs from before."""

    sent: list[tuple[str, bytes]]
    deadline: float
    state: NodeState | None = None


class GrantAnswer(Struct, frozen=True, array_like=True):
    """Answer to the grant of this number: the results of its first calls, at least one."""

    number: int
    results: tuple[CallResult, ...]
