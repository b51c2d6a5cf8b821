"""Cuts of links between the hosts of a simulation, of leases alone or of complete agents."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Set

from lfa.protocol.names import WITNESS_ID, robot_name
from lfa.protocol.topics import WORLD_NAME
from lfa.protocol.transport.link_model import Link, LinkModel

Pairs = Set[tuple[int, int]]
"""Directed pairs of ids: from, to."""


class Partitioned(ABC):
    """Simulation whose hosts can be cut off from each other; the cuts are those of its link model."""

    link_model: LinkModel
    cuts: Pairs = frozenset()
    """Directed pairs of ids between which no message passes."""

    def part(self, pairs: Pairs) -> None:
        """Block all messages from the first to the second id of each pair."""
        self._cut_exactly(self.cuts | pairs)

    def heal_partition(self, pairs: Pairs) -> None:
        """Remove the cuts of these directed pairs."""
        self._cut_exactly(self.cuts - pairs)

    def heal(self) -> None:
        """Remove all cuts."""
        self._cut_exactly(frozenset())

    def _cut_exactly(self, pairs: Pairs) -> None:
        self.cuts, self.link_model.cuts = pairs, links(pairs)
        self._tell_cuts()

    @abstractmethod
    def _tell_cuts(self) -> None:
        """Notify the checkers of the links that are cut from now on."""


def place(host: int) -> str:
    """Return the place of a host in the link model; id 0 is the host of the witness and the world."""
    return WORLD_NAME if host == WITNESS_ID else robot_name(host)


def links(pairs: Pairs) -> frozenset[Link]:
    """Return the links between these hosts."""
    return frozenset((place(one), place(other)) for one, other in pairs)
