"""What a policy sees of its robot, and what its step was worth, from the messages of a run."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

import numpy as np
import numpy.typing as npt

from lfa.protocol.geometry import Pose2D, in_base
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.messages.simulation import TrueRobot, Truth
from lfa.protocol.messages.team import Event, Tracking
from lfa.protocol.names import robot_id_of
from lfa.protocol.topics import address
from lfa.world.description.scenario import Scenario

SECTORS = 36
"""Number of sectors that a scan is divided into, counter-clockwise from behind the robot."""
FIELDS = ("goal_x", "goal_y", "slot_x", "slot_y", "ahead_x", "ahead_y", "linear_x", "angular_z", "leads")
"""First values of an observation: goal, slot and predecessor [m] in `base_link` (0, 0 where there is none), own twist
[m/s, rad/s], and 1 for the leader; the nearest range [m] of each sector follows."""
SIZE = len(FIELDS) + SECTORS
CONTACT_COST = 1.0

Observation = npt.NDArray[np.float32]


class TeamView:
    """Newest values of each robot of a drawn `scenario`. Poses are the ground truth's, ranges those of its scanner."""

    def __init__(self, scenario: Scenario) -> None:
        self._goal_m = scenario.mission.goal_m
        self._far_m = scenario.world.lidar.range_max_m
        self._true: dict[int, TrueRobot] = {}
        self._tracking: dict[int, Tracking] = {}
        self._scans: dict[int, LaserScan] = {}
        self._contacts: dict[int, int] = {}
        self._goal_gap_m: dict[int, float] = {}
        """Distance [m] of each robot to the goal at its last reward."""

    def record(self, _t: float, key: str, message: Message) -> None:
        """Take in a message of the run."""
        where = address(key)
        robot = None if where is None else robot_id_of(where.owner)
        match message:
            case Truth(robots=robots):
                self._true = {true.id: true for true in robots}
            case Tracking() if robot is not None:
                self._tracking[robot] = message
            case LaserScan() if robot is not None:
                self._scans[robot] = message
            case Event(kind="contact", data={"robot": int() as touched}):
                self._contacts[touched] = self._contacts.get(touched, 0) + 1

    def observation(self, robot: int, leader: int | None) -> Observation:
        """Return what the policy of `robot` sees: `FIELDS`, then the sectors of its scan."""
        seen = np.zeros(SIZE, np.float32)
        seen[len(FIELDS) :] = self._sectors(self._scans.get(robot))
        true, tracking = self._true.get(robot), self._tracking.get(robot)
        if true is None:
            return seen
        pose = Pose2D(true.x, true.y, true.theta)
        places = [self._goal_m]
        if tracking is not None and robot != leader:
            ahead = self._true.get(tracking.predecessor, true)
            places += [(tracking.slot_map.x, tracking.slot_map.y), (ahead.x, ahead.y)]
        for n, place in enumerate(places):
            seen[2 * n : 2 * n + 2] = in_base(pose, place)
        seen[6:9] = true.linear_x, true.angular_z, robot == leader
        return seen

    def reward(self, robot: int, leader: int | None) -> float:
        """Return the worth of the time since the last call: way gained towards the goal [m] for the leader, minus the
        distance [m] to its slot for a follower; each contact that began costs 1.
        """
        worth = -CONTACT_COST * self._contacts.pop(robot, 0)
        true, tracking = self._true.get(robot), self._tracking.get(robot)
        if true is None:
            return worth
        gap_m = hypot(true.x - self._goal_m[0], true.y - self._goal_m[1])
        gained_m, self._goal_gap_m[robot] = self._goal_gap_m.get(robot, gap_m) - gap_m, gap_m
        if robot == leader:
            return worth + gained_m
        if tracking is None:
            return worth
        return worth - hypot(true.x - tracking.slot_map.x, true.y - tracking.slot_map.y)

    def _sectors(self, scan: LaserScan | None) -> npt.NDArray[np.float64] | Sequence[float]:
        """Return the nearest range [m] in each sector, `range_max_m` where nothing is; a bad reading is nothing."""
        if scan is None:
            return [self._far_m] * SECTORS
        ranges = np.nan_to_num(np.array(scan.ranges_m), nan=self._far_m, posinf=self._far_m, neginf=scan.range_min_m)
        return np.array([part.min(initial=self._far_m) for part in np.array_split(ranges, SECTORS)])
