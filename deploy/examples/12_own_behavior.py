"""Write a behaviour: what a robot does besides its role. This one creeps past whatever stands near it."""

from math import hypot, inf

from lfa.agents.behaviors.own_behavior import BehaviorInput, add_behavior
from lfa.deploy.simulate import run
from lfa.protocol.geometry import Twist
from lfa.protocol.mission import Mission

SLOW_MPS = 0.15


class Cautious:
    """Drive slowly within a metre of anything that stands."""

    def __init__(self, mission: Mission) -> None:
        self.near_m = mission.radius_m + 1.0

    def step(self, seen: BehaviorInput) -> Twist | None:
        nearest_m = min((hypot(x, y) for x, y in seen.still), default=inf)
        v = seen.wanted.linear_x
        if nearest_m > self.near_m or v <= SLOW_MPS:
            return None  # what the role wants is right
        return Twist(SLOW_MPS, seen.wanted.angular_z * SLOW_MPS / v)


if __name__ == "__main__":
    add_behavior("cautious", Cautious)
    route = "mission.leading.route_m=[[0.0, 0.0], [6.0, 0.0]]"
    post = "world.obstacles=[{center_m=[3.0, 1.0], radius_m=0.2}]"
    for behaviors in ([], ["cautious"]):
        done = run("straight", robots=1, set=[post, route, f"mission.behaviors={behaviors}"])
        print(f"{behaviors!s:12} {done.summary.outcome} after {done.summary.sim_duration_s:.0f} s")
