"""Incarnations of the processes of a simulated team: agents and the witness, and the world with all gateways."""

from __future__ import annotations

from msgspec import Struct

from lfa.agents.agent import Agent
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.messages.consensus import Member
from lfa.protocol.node import Node
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.witness import Witness
from lfa.world.simulator import Simulator
from lfa.world.virtual_time import LocalClock
from lfa.world.world import World


class AgentProcess:
    """One incarnation of an agent or of the witness."""

    def __init__(self, simulator: Simulator, node: Agent | Witness, member: Member, clock: LocalClock) -> None:
        self.node = node
        self.member = member
        self.id = member.id
        self.clock = clock
        self.paused = False
        self.leaving = False
        """True after a request to exit, while the process sends its last messages."""
        self.drawn: tuple[str, bytes] | None = None
        """Key and payload of the last command published as leader; a pause may hold it back."""
        self.simulator = simulator

    @property
    def alive(self) -> bool:
        """True while this incarnation runs in the simulator."""
        return self.simulator.runs(self.node)

    @property
    def lease(self) -> Lease | None:
        """Lease of the node; None just after its start."""
        return self.node.lease


class WorldProcess(Struct):
    """One incarnation of the world, and so of all gateways."""

    world: World
    clock: LocalClock
    alive: bool = True


def unread(node: Node) -> Journal:
    """Return a journal that keeps nothing, for `node`."""
    return Journal(None, Heading(JOURNAL_VERSION, node.name, node.incarnation, 1, {}))
