"""Connect hardware of your own: two methods, `drive` and `read`; the driver around them holds the robot's gateway.

Here robot 2 of a simulated team is such hardware, in virtual time; on a robot, `main` of deploy/robot/cli.py runs it.
"""

from lfa.deploy.robot.base import Reading
from lfa.deploy.simulate import run
from lfa.protocol.geometry import STILL, Pose2D, along_arc, compose
from lfa.protocol.geometry import Twist as Velocity
from lfa.protocol.mission import Limits

START = Pose2D(-0.6, 1.04, 0.0)


class Wheels:
    """Wheels that do at once what they are told; a real class writes to motors and reads encoders instead."""

    def __init__(self, limits: Limits, now: float) -> None:
        self.pose, self.twist, self.way_m, self.at = Pose2D(), STILL, 0.0, now

    def drive(self, twist: Velocity, now: float) -> None:
        self.twist = twist

    def read(self, now: float) -> Reading:
        dt, self.at = now - self.at, now
        self.pose = along_arc(self.pose, self.twist, dt)
        self.way_m += abs(self.twist.linear_x) * dt
        return Reading(self.pose, self.twist, self.way_m, pose_map=compose(START, self.pose))


done = run("straight", robots=3, set=["mission.leading.route_m=[[4.0, 0.0]]"], drivers={2: Wheels})
x, y = done.truth[2][-1, 1:3]
print(f"{done.summary.outcome}: robot 2 was driven from ({START.x}, {START.y}) to ({x:.2f}, {y:.2f})")
