"""Write a sensor: the light of a lamp, measured by each robot; a controller of your own slows down in the dark."""

from math import hypot
from random import Random

from msgspec import Struct

from lfa.agents.following.controller import Law, Reference, add_controller
from lfa.deploy.simulate import run
from lfa.protocol.geometry import Pose2D, Twist
from lfa.world.description.own_sensor import TrueState, add_sensor
from lfa.world.description.scenario import Scenario


class Light:
    class Parameters(Struct, frozen=True, forbid_unknown_fields=True):
        lamp_m: tuple[float, float] = (0.0, 0.0)

    def __init__(self, scenario: Scenario, chance: Random, parameters: Parameters) -> None:
        self.lamp_m, self.chance = parameters.lamp_m, chance

    def measure(self, state: TrueState) -> dict[str, float]:
        far_m = hypot(state.pose.x - self.lamp_m[0], state.pose.y - self.lamp_m[1])
        return {"lux": 100.0 / (1.0 + far_m**2) + self.chance.gauss(0.0, 0.1)}


class Careful(Law):
    def step(self, reference: Reference, own_pose: Pose2D, own_twist: Twist, dt: float) -> Twist:
        twist, light = super().step(reference, own_pose, own_twist, dt), reference.readings.get("light")
        return Twist(0.8 * twist.linear_x, twist.angular_z) if light and light.values["lux"] < 10.0 else twist


if __name__ == "__main__":
    add_sensor("light", Light)
    add_controller("careful", Careful)
    for name in ("law", "careful"):
        sets = ["world.sensors.light.rate_hz=5", f"mission.following.controller={name}", "goal=5,0"]
        done = run("straight", robots=2, set=sets)
        print(f"{name:8} {done.summary.outcome}, last reading (time, values): {done.readings[2]['light'][-1]}")
