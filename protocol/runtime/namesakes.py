"""Refusal of a second process of one name in a fleet: an earlier one still runs, or another starts at the same time.

Two processes of one name would share its keys and its vote. A liveliness token alone does not prove that its owner
runs: that of a killed process remains until its link's lease ends.
"""

from __future__ import annotations

from lfa.protocol import clock
from lfa.protocol.errors import Refused
from lfa.protocol.incarnations import is_later
from lfa.protocol.names import robot_id_of
from lfa.protocol.node import Node
from lfa.protocol.topics import TO_ALL, TO_HELLO, TOPICS, address, key
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.message_bus import Decoder
from lfa.protocol.transport.zenoh_bus import ZenohBus

NAMESAKE_LEASES = 1.75  # of the two that are waited: a process that waits for its mission publishes only once a second
OLDER_LEASES, YOUNGER_LEASES = 2.0, 6.0
"""Link leases that the older and the younger of two twins wait for a word of the other; a process that has waited says
its first within half a second."""


def said_by(fleet: str, name: str) -> frozenset[str]:
    """Return the keys on which a process of this name may be heard: a list, as a secured router admits no wildcard."""
    lease = {key(fleet, name, "lease", to) for to in (TO_ALL, TO_HELLO)}
    return frozenset(lease | {key(fleet, name, topic.name) for topic in TOPICS if topic.name != "lease"})


def refuse_double(bus: ZenohBus, inbox: Inbox, fleet: str, lease_s: float, node: Node) -> list[int]:
    """Wait two link leases for the token of an earlier incarnation of this name to vanish.

    Returns the incarnations whose tokens remain but that are silent, hence presumed dead. Raises Refused if one of them
    still publishes.
    """
    dead = bus.living(fleet, node.name)
    if not dead:
        return []
    bus.follow(said_by(fleet, node.name))
    heard: dict[int, float] = {}
    patience_until = clock.now() + 2.0 * lease_s
    while clock.now() < patience_until:
        clock.sleep(0.05)
        heard.update(_speakers(inbox))
        dead = bus.living(fleet, node.name)
        if not dead:
            break
    else:
        since = clock.now() - NAMESAKE_LEASES * lease_s
        if any(heard.get(one, since) > since for one in dead):
            raise _double(fleet, node)
    bus.follow(frozenset())
    inbox.take()
    return dead


def refuse_twin(bus: ZenohBus, inbox: Inbox, fleet: str, lease_s: float, node: Node, dead: list[int]) -> None:
    """Resolve two simultaneous starts of one name, which see each other only after announcing: the younger gives way.

    Neither publishes before the older has waited; then the younger hears it. A token that nobody speaks under is no
    twin's, though `refuse_double` has not seen it: on a busy machine a router's answer may leave tokens out. Raises
    Refused if another incarnation speaks.
    """

    def twins() -> list[int]:
        return [one for one in bus.living(fleet, node.name) if one not in (node.incarnation, *dead)]

    found = twins()
    if not found:
        return
    is_older = all(is_later(one, node.incarnation) for one in found)
    patience_until = clock.now() + (OLDER_LEASES if is_older else YOUNGER_LEASES) * lease_s
    bus.follow(said_by(fleet, node.name))
    while found and clock.now() < patience_until:
        clock.sleep(0.05)
        if set(found) & _speakers(inbox).keys():
            raise _double(fleet, node)
        found = twins()
    bus.follow(frozenset())
    inbox.take()


def _double(fleet: str, node: Node) -> Refused:
    other = "--id" if robot_id_of(node.name) else "--fleet"
    return Refused(f"{node.name} already runs in fleet {fleet!r}: end that one, or give another {other}")


def _speakers(inbox: Inbox) -> dict[int, float]:
    """Return the incarnations that sent a well-formed message, with the arrival time [s] of the last one."""
    heard: dict[int, float] = {}
    for arrival, message in Decoder().messages(inbox.take()):
        where = address(arrival.key)
        if where is not None and message.header.sender == where.owner:
            heard[message.header.incarnation] = arrival.at
    return heard
