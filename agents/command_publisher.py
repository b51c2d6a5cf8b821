"""Publication of a robot's commands: none without a fresh gateway stamp, and none as leader without a valid lease."""

from __future__ import annotations

from lfa.agents.chain_place import ChainPlace
from lfa.agents.orders.stop_listener import StopListener
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import Twist
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.outbox import Outbox


class CommandPublisher:
    """Publisher of `cmd_vel` for robot `robot_id`."""

    def __init__(
        self, robot_id: int, outbox: Outbox, team: TeamState, lease: Lease, place: ChainPlace, stop: StopListener
    ) -> None:
        self._id = robot_id
        self._outbox = outbox
        self._team = team
        self._lease = lease
        self._place = place
        self._stop = stop

    def publish(self, twist: Twist, now: float, *, as_leader: bool) -> None:
        """Publish `twist`. The gateway's stamp is read before the lease is checked (lease.md section 5)."""
        sensors, lease = self._team.fresh_sensors(now), self._lease
        if sensors is None:
            return
        if as_leader:
            if not lease.may_command(now):
                return
            lease.commanded(now)
        term = lease.term if as_leader else lease.config.version.term
        holder = self._id if as_leader else self._place.first
        header = self._outbox.header("cmd_vel", now)
        cmd = CmdVel(header, twist, term, holder, as_leader, sensors.gateway, self._stop.known, lease.grant_s)
        self._outbox.publish("cmd_vel", cmd)
