"""Team-mates of one robot: where each of them is, as far as it is known."""

from __future__ import annotations

from math import cos, sin

from lfa.agents.following.predecessor import Predecessor
from lfa.agents.perception.obstacle_tracker import Feature
from lfa.agents.perception.scan import Point
from lfa.agents.team_state import TeamState
from lfa.protocol.geometry import Pose2D, in_base


class TeamMates:
    """The other robots that tell where they are, and the one that this robot follows."""

    def __init__(self, robot_id: int, team: TeamState) -> None:
        self.own_id = robot_id
        self._team = team
        self.predecessor: Predecessor | None = None
        self._heard: tuple[int, ...] = ()
        self._rest: tuple[int, ...] = ()
        """Robots of which a row was heard, and those of them that are others than this one."""

    def places(self, now: float) -> list[Pose2D]:
        """Return the known poses in `map`: the predecessor's from its pose messages, the others' from the table."""
        places = [self._team.pose_of(robot, now) for robot in self._others()]
        if self.predecessor is not None:
            sighting = self.predecessor.at(now)
            places.append(None if sighting is None else sighting.pose)
        return [place for place in places if place is not None]

    def nearby(self, pose: Pose2D, within_m: float, now: float) -> list[Pose2D]:
        """Return those of `places` that may be within `within_m` of `pose`."""
        near = [place for _, place in self._team.near(self._others(), pose, within_m, now)]
        sighting = None if self.predecessor is None else self.predecessor.at(now)
        return near if sighting is None else [*near, sighting.pose]

    def strangers(self, pose: Pose2D, within_m: float, now: float, *, by_law: bool = True) -> list[Point]:
        """Return those to which no controller keeps a distance, in `base_link`: all but the one that this robot follows
        `by_law`. On a way of its own (back to its slot, out of a trap) the law does not keep that distance either.

        None within `within_m` is left out; others may be.
        """
        ahead = None if self.predecessor is None else self.predecessor.robot
        c, s, mates = cos(pose.theta), sin(pose.theta), list[Point]()
        if self.predecessor is not None and not by_law:
            sighting = self.predecessor.at(now)
            if sighting is None:  # since it was made its predecessor, no pose has come: its row tells where it is
                ahead = None
            else:
                mates.append(in_base(pose, (sighting.pose.x, sighting.pose.y)))
        for robot, place in self._team.near(self._others(), pose, within_m, now):
            if robot != ahead:
                dx, dy = place.x - pose.x, place.y - pose.y
                mates.append((c * dx + s * dy, c * dy - s * dx))
        return mates

    def moving(self, pose: Pose2D, within_m: float, now: float) -> list[Feature]:
        """Return those within `within_m` of `pose` as what moves in `map`; their radius is 0."""
        found = []
        for robot, place in self._team.near(self._others(), pose, within_m, now):
            vx, vy = self._team.velocity_of(robot)
            if self.predecessor is not None and robot == self.predecessor.robot:
                sighting = self.predecessor.at(now)
                if sighting is not None:
                    place, v = sighting.pose, sighting.twist.linear_x
                    vx, vy = v * cos(place.theta), v * sin(place.theta)
            found.append(Feature("moving", place.x, place.y, 0.0, vx, vy))
        return found

    def _others(self) -> tuple[int, ...]:
        """Return the other robots; made anew only when one more has been heard, for each control step asks."""
        robots = self._team.robots
        if robots is not self._heard:
            self._heard, self._rest = robots, tuple(robot for robot in robots if robot != self.own_id)
        return self._rest
