"""The interface between a core and whatever runs it: real time, virtual time, or a replay.

A Node never reads a clock, a socket, an environment variable or a global random generator. All that can change
it comes in through `receive` and `tick`, with the receiver's own monotonic time; all that it does goes out
as Envelopes. The same calls in the same order give the same answers: that is what `journal.py` records.
"""

from __future__ import annotations

from typing import Any, Protocol

from msgspec import Struct

from lfa.protocol.messages.codec import Message


class PeerUp(Struct, frozen=True, array_like=True, tag="peer_up"):
    """A liveliness token appeared. It does not yet mean that its owner can be reached."""

    name: str
    incarnation: int


class PeerDown(Struct, frozen=True, array_like=True, tag="peer_down"):
    """A liveliness token vanished: a hint, never a proof (lease.md section 4)."""

    name: str
    incarnation: int


class RouterLost(Struct, frozen=True, array_like=True, tag="router_lost"):
    """The own link to the router is gone: what follows from here says nothing about others."""


class Vitals(Struct, frozen=True, array_like=True, tag="vitals"):
    """What the shell knows about itself, once a second, so that the core can report it in `status`."""

    loop_lag_s: float
    dropped: int
    undecodable: int
    cpu_percent: float
    rss_mib: float
    tick_p99_s: float = 0.0
    """Processor time of a tick, the 99th percentile of the newest."""


class Stop(Struct, frozen=True, array_like=True, tag="stop"):
    """SIGTERM or Ctrl-C: say the last words, then be `finished`."""


Local = PeerUp | PeerDown | RouterLost | Vitals | Stop


class Received(Struct, frozen=True, gc=False):
    """Something came: a message from the network, or a local event (`key` is then empty)."""

    at: float
    key: str
    message: Message | Local


class Envelope(Struct, frozen=True, gc=False):
    """A message and the key that it is to be published on."""

    key: str
    message: Message


class Node(Protocol):
    """Agent, world, witness and drivers are Nodes."""

    @property
    def name(self) -> str:
        """Unique in the fleet: `robot2`, `world`, `witness`."""

    @property
    def incarnation(self) -> int:
        """Which start of this name it is: grows from start to start."""

    @property
    def started_with(self) -> dict[str, Any]:
        """As plain data, what it was started with: `kind` and what else a replay needs to start it again."""

    @property
    def interests(self) -> frozenset[str]:
        """Key expressions that it wants to hear at the moment; the shell follows changes."""

    @property
    def finished(self) -> bool:
        """True when the last words are spoken; the shell then ends the process."""

    @property
    def refusal(self) -> str | None:
        """One line that says why it cannot take part at all (the process then exits 2), or None."""

    def receive(self, received: Received) -> list[Envelope]:
        """Something came."""

    def tick(self, now: float) -> list[Envelope]:
        """The deadline passed."""

    def next_deadline(self) -> float:
        """When to tick next, in the node's own monotonic time."""
