"""The interface between a core and its runner: real time, virtual time, or a replay.

A Node never reads a clock, a socket, an environment variable or a global random generator. All input comes
through `receive` and `tick`, with the receiver's own monotonic time; all output is returned as Envelopes. The
same calls in the same order give the same answers; `journal.py` records them.
"""

from __future__ import annotations

from typing import Any, Protocol

from msgspec import Struct

from lfa.protocol.messages.codec import Message


class PeerUp(Struct, frozen=True, array_like=True, tag="peer_up"):
    """Liveliness event: a token appeared. Its owner may still be unreachable."""

    name: str
    incarnation: int


class PeerDown(Struct, frozen=True, array_like=True, tag="peer_down"):
    """Liveliness event: a token vanished. It suggests that its owner died and never proves it (lease.md section 4)."""

    name: str
    incarnation: int


class RouterLost(Struct, frozen=True, array_like=True, tag="router_lost"):
    """Loss of this process's own link to the router; liveliness events after it say nothing about other processes."""


class Vitals(Struct, frozen=True, array_like=True, tag="vitals"):
    """The runner's own measurements, delivered once a second so that the core can report them in `status`."""

    loop_lag_s: float
    dropped: int
    undecodable: int
    cpu_percent: float
    rss_mib: float
    tick_p99_s: float = 0.0
    """Processor time [s] of a tick, 99th percentile of the newest ticks."""
    refused: tuple[tuple[str, int], ...] = ()
    """The members of which most was refused, for their rates or numbers of tokens, with the numbers since the start."""


class Stop(Struct, frozen=True, array_like=True, tag="stop"):
    """SIGTERM or Ctrl-C: publish the final messages, then become `finished`."""


Local = PeerUp | PeerDown | RouterLost | Vitals | Stop


class Received(Struct, frozen=True, gc=False):
    """Input of a Node: a message from the network, or a local event (`key` is then empty)."""

    at: float
    key: str
    message: Message | Local


class Envelope(Struct, frozen=True, gc=False):
    """Output of a Node: a message and the key to publish it on."""

    key: str
    message: Message


class Node(Protocol):
    """Deterministic core of one process: agent, world, witness or driver."""

    @property
    def name(self) -> str:
        """Name, unique in the fleet: `robot2`, `world`, `witness`."""

    @property
    def incarnation(self) -> int:
        """Number of this start of the name; it grows from start to start."""

    @property
    def started_with(self) -> dict[str, Any]:
        """Start arguments as plain data: `kind`, and all else that a replay needs to start the node again."""

    @property
    def interests(self) -> frozenset[str]:
        """Key expressions that the node subscribes to at the moment; the runner follows changes."""

    @property
    def defer_hellos(self) -> bool:
        """True if HELLO, which processes without a vote repeat, can wait for the node's next deadline."""

    @property
    def defer_grants(self) -> bool:
        """True while answers on `lease` to this node alone, GRANT above all, can wait for its next deadline."""

    @property
    def finished(self) -> bool:
        """True when the final messages are out; the runner then ends the process."""

    @property
    def refusal(self) -> str | None:
        """Reason, in one line, why the node cannot take part at all (the process then exits with 2), or None."""

    def receive(self, received: Received) -> list[Envelope]:
        """Process one input and return the messages to publish."""

    def tick(self, now: float) -> list[Envelope]:
        """Do what is due at `now` [s] and return the messages to publish."""

    def next_deadline(self) -> float:
        """Return the time [s] of the next tick, in the node's own monotonic time."""


class NodeObserver(Protocol):
    """Observer of one node, for checkers and tools: its host calls it around each input. It changes nothing."""

    def before(self, received: Received) -> None:
        """Process an input that the node gets next."""

    def after(self, received: Received) -> None:
        """Process an input that the node has processed; what it answered is not published yet."""


def lacks_messages(node: Node) -> bool:
    """Return True while the node lacks messages that its team sends: its subscriptions are then declared again (E27).

    Always False for a node that follows no team: world, driver.
    """
    lacks: bool = getattr(node, "lacks_messages", False)
    return lacks


def defers_rounds(node: Node) -> bool:
    """Return True while what is said on `lease` to all, PROPOSE above all, can wait for the node's next deadline.

    False for a node that does not say it: world, witness, driver.
    """
    return bool(getattr(node, "defer_rounds", False))


def may_end(node: Node) -> bool:
    """Return False if the node says that nothing ends it: it is asked after each call, and then for nothing more.

    True for a node that does not say it: its `refusal`, `reborn` and `finished` are asked.
    """
    says: bool = getattr(node, "may_end", True)
    return says


def waits_for(node: Node) -> str | None:
    """Return what a node waits for before it can take part, as text for its terminal; None when it takes part."""
    missing: str | None = getattr(node, "waits_for", None)
    return missing


def reborn(node: Node) -> Node | None:
    """Return the node to run in the place of this one, under a later number, once others know a later one (E23).

    None for most of the time, and always for a node whose number is not compared with earlier ones: world, driver.
    """
    later: Node | None = getattr(node, "reborn", None)
    return later
