"""Write a scenario generator: posts left and right of a straight way, another slalom for each seed."""

from random import Random

from msgspec import Struct
from msgspec.structs import replace

from lfa.deploy.simulate import run
from lfa.world.description.generator import add_generator
from lfa.world.description.scenario import Obstacle, Scenario


class Slalom:
    """Posts beside a straight way, at random distances from it."""

    class Parameters(Struct, frozen=True, forbid_unknown_fields=True):
        posts: int = 3
        apart_m: float = 3.0

    def __init__(self, parameters: Parameters) -> None:
        self.posts, self.apart_m = parameters.posts, parameters.apart_m

    def generate(self, scenario: Scenario, chance: Random) -> Scenario:
        xs = [self.apart_m * (n + 1) for n in range(self.posts)]
        posts = [Obstacle(center_m=(x, chance.uniform(-1.0, 1.0)), radius_m=0.2) for x in xs]
        leading = replace(scenario.mission.leading, route_m=((self.apart_m * (self.posts + 1), 0.0),))
        return replace(scenario, mission=replace(scenario.mission, leading=leading),
                       world=replace(scenario.world, obstacles=tuple(posts)))  # fmt: skip


if __name__ == "__main__":
    add_generator("slalom", Slalom)
    for seed in (1, 2):
        done = run("slalom", seed=seed, robots=2, set=["generator.parameters.posts=2"])
        posts = ", ".join(f"({x:.0f}, {y:+.2f})" for x, y in (o.center_m for o in done.scenario.world.obstacles))
        print(f"seed {seed}: {done.summary.outcome} past posts at {posts}")
