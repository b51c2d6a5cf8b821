"""Policy for a stuck robot, for itself and for its team (control.md section 7; rule E22).

A stuck leader hands the lease over to the next in the chain, once for each place; the mission fails when it is stuck
there again. A follower reports that it is stuck; when the leader has waited for it long enough, the chain closes over
it. The follower keeps trying to come behind the last of the chain, and is taken in again there when it is free.

A robot without a pose (S6) neither leads nor holds others up: as a leader it hands over as soon as another robot can
lead; as a follower it is not waited for.
"""

from __future__ import annotations

from math import floor, inf

from lfa.agents.navigator import Navigator
from lfa.agents.perception.obstacle_model import TRAP_M
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import Pose2D
from lfa.protocol.lease.machine.lease import Lease
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.team import ObstacleNote
from lfa.protocol.mission import Mission
from lfa.protocol.outbox import Outbox

HANDOVER_S = 2.0
"""Minimum time [s] between two hand-overs that a stuck leader requests."""
NEWS_S = 1.0
"""Time [s] within which a new leader has received that the former leader is stuck."""
PLACE_M = 1.0
"""Side [m] of the cell within which being stuck twice counts as stuck in the same place."""


class StuckPolicy:
    """Stuck policy of one robot; `step` is called after each control step."""

    def __init__(self, robot_id: int, mission: Mission, outbox: Outbox, team: TeamState) -> None:
        self._id = robot_id
        self._outbox = outbox
        self._team = team
        self._said: str | None = None
        self._failed = False
        self._next_handover = 0.0
        self._given_up: list[tuple[int, int]] = []
        self._led_before: int | None = None
        """Robot that handed the lease over, until it is no longer stuck."""
        self._reign_from = 0.0

    def step(self, role: Role, pose: Pose2D | None, lease: Lease, driver: Navigator, now: float) -> bool:
        """Publish changes of the stuck state; return True when the lease is to be handed over now. `pose` is None while
        the robot has none.
        """
        if driver.stuck != self._said:
            self._said = driver.stuck
            self._event("stuck", now, lease, {"reason": driver.stuck or "", "stuck": driver.stuck is not None})
        broken = driver.failure
        if broken is not None:
            self._fail(broken, lease, now, controller=True)
        if role is not Role.LEADER:
            lease.left_out, chain = frozenset(), lease.chain
            self._led_before = chain[0] if chain else None
            self._reign_from = now
            if self._id not in chain and pose is not None:
                driver.back_out(pose)
            return False
        lease.left_out = self._left_out(lease, driver, now)
        if driver.leading.failure is not None:
            self._fail(driver.leading.failure, lease, now)
        return driver.stuck is not None and now >= self._next_handover and self._gives_up(pose, lease, driver, now)

    def _left_out(self, lease: Lease, driver: Navigator, now: float) -> frozenset[int]:
        """Return the robots left out of the chain: stuck robots outside of it stay out, also the former leader that
        handed the lease over; the other stuck ones are left out once the leader has waited for them.
        """
        before = self._led_before
        if before is not None and now >= self._reign_from + NEWS_S and not self._team.stuck(before, now):
            self._led_before = None
        chain = lease.chain
        waited_for = () if driver.leading.waited_out else [robot for robot in chain if self._waits_for(robot, now)]
        stuck = {robot for robot in self._team.robots if robot not in waited_for and self._team.stuck(robot, now)}
        for robot in stuck.intersection(chain) - lease.left_out:
            self._event("left_out", now, lease, {"robot_left": robot})
        return frozenset(stuck)

    def _waits_for(self, robot: int, now: float) -> bool:
        return robot != self._led_before and not self._team.placeless(robot, now)

    def _gives_up(self, pose: Pose2D | None, lease: Lease, driver: Navigator, now: float) -> bool:
        """Return whether to hand over; otherwise the mission has failed, or the lease has no other robot."""
        self._next_handover = now + HANDOVER_S
        if pose is None or driver.pose_lost:  # at no place: the pose returns when the hardware restarts
            return any(self._team.can_lead(robot, now) for robot in lease.chain if robot != self._id)
        place = (floor(pose.x / PLACE_M), floor(pose.y / PLACE_M))
        if place in self._given_up or len(lease.chain) == 1:
            self._next_handover = inf
            again = "stuck again" if place in self._given_up else "stuck, and nobody is left to lead"
            self._fail(f"robot {self._id} is {again}: {driver.stuck}", lease, now)
            return False
        self._given_up.append(place)
        header = self._outbox.header("obstacles", now)
        self._outbox.publish("obstacles", ObstacleNote(header, "trap", pose.x, pose.y, TRAP_M))
        driver.back_out(pose)
        return True

    def _fail(self, reason: str, lease: Lease, now: float, **data: object) -> None:
        """Publish once that the mission has failed."""
        if not self._failed:
            self._failed = True
            self._event("failed", now, lease, {"reason": reason, **data})

    def _event(self, kind: str, now: float, lease: Lease, data: dict[str, object]) -> None:
        self._outbox.event(kind, now, lease.term, data)
