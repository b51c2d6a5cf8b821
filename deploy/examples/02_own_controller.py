"""Write a controller: from a slot that moves, to a twist. The table compares it with the default one, `law`."""

from math import atan2, cos, sin

from lfa.agents.config import Gains
from lfa.agents.following.controller import Reference, add_controller
from lfa.deploy.simulate import run
from lfa.protocol.geometry import Pose2D, Twist, wrap
from lfa.protocol.mission import Limits


class Carrot:
    """Drive at a point half a metre ahead of the slot, faster the farther the slot is."""

    def __init__(self, gains: Gains, limits: Limits) -> None:
        self.gain = gains.k_per_s

    def reset(self, own_pose: Pose2D, own_twist: Twist) -> None:
        """Nothing is remembered from step to step."""

    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
        dx, dy = reference.x - own_pose.x, reference.y - own_pose.y
        ahead_x, ahead_y = dx + 0.5 * cos(reference.heading), dy + 0.5 * sin(reference.heading)
        turn = wrap(atan2(ahead_y, ahead_x) - own_pose.theta)
        gap = dx * cos(own_pose.theta) + dy * sin(own_pose.theta)
        return Twist(reference.speed + self.gain * gap, 2.0 * turn + reference.turn_rate)


add_controller("carrot", Carrot)
bend = "mission.leading.route_m=[[2.0, 0.0], [4.0, 1.0], [6.0, 1.0]]"
for name in ("law", "carrot"):
    done = run("straight", robots=3, set=[bend, f"mission.following.controller={name}"])
    worst_m = max(robot.distance_error_rms_m or 0.0 for robot in done.summary.robots)
    print(f"{name:8} {done.summary.outcome}, distance error of the worst follower {1000.0 * worst_m:.1f} mm (rms)")
