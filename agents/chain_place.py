"""Place of one robot in the chain of its lease: its role, the robot that it follows, and its neighbours."""

from __future__ import annotations

from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.lease.quorum import electors
from lfa.protocol.messages.consensus import Role


class ChainPlace:
    """The chain of `lease` as seen by robot `robot_id`."""

    def __init__(self, robot_id: int, lease: Lease) -> None:
        self._id = robot_id
        self._lease = lease
        self._config = lease.config
        self._take(lease.chain)

    def _take(self, chain: tuple[int, ...]) -> None:
        self._ids: tuple[int, ...] = chain
        self._neighbours: tuple[int, ...] = ()
        self._votes = self._lease.me in electors(self._lease.config)
        if self._id in chain:
            place = chain.index(self._id)
            self._neighbours = chain[max(0, place - 1) : place] + chain[place + 1 : place + 2]

    @property
    def ids(self) -> tuple[int, ...]:
        """Ids of the chain, leader first; computed anew only when the config has changed (read many times a step)."""
        config = self._lease.config
        if config is not self._config:
            self._config = config
            self._take(self._lease.chain)
        return self._ids

    @property
    def votes(self) -> bool:
        """True if this incarnation has a vote in the newest config known, or in the one before while that changes."""
        return self._votes if self.ids else False

    @property
    def first(self) -> int:
        """Id of the robot that leads the chain; 0 before the first chain."""
        return (self.ids or (0,))[0]

    def role(self, follows: bool) -> Role:
        """Return the present role; `follows`: a predecessor is set."""
        if self._lease.role is Role.LEADER:
            return Role.LEADER
        return Role.FOLLOWER if follows and self._id != self.first else Role.WAITING

    def ahead(self, stuck: bool) -> int | None:
        """Return the robot to follow; None for none. A `stuck` robot left out of it tries to join the tail (E22), but
        none that an operator has retired (E34).
        """
        chain, stuck = self.ids, stuck and self._id not in self._config.roster.retired
        if self._id not in chain:
            return chain[-1] if chain and stuck else None
        place = chain.index(self._id)
        return chain[place - 1] if place > 0 else None

    @property
    def neighbours(self) -> tuple[int, ...]:
        """Robots directly before and behind; empty outside of the chain."""
        return self._neighbours if self.ids else ()
