"""Make a scenario from Python objects: a team, a route, an obstacle in the way, and what the run must reach."""

from lfa.deploy.simulate import run
from lfa.protocol.mission import FormationSpec, Leading, Mission
from lfa.world.description.scenario import Assert, Noise, Obstacle, Scenario, WorldSpec

scenario = Scenario(
    title="Two robots and a box",
    name="two_and_a_box",
    time_limit_s=60.0,
    mission=Mission(
        robots=(1, 2),
        formation=FormationSpec(separation_m=1.0, side="column", heading_filter_m=0.6),
        leading=Leading(route_m=((6.0, 0.0),), cruise_mps=0.5),
    ),
    world=WorldSpec(
        obstacles=(Obstacle(center_m=(3.0, 0.1), corners_m=((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2))),),
        noise=Noise(localization_m=0.002, range_m=0.005),
    ),
    asserted=Assert(contacts_max=0, separation_min_m=0.4),
)

done = run(scenario, seed=1)
for assertion in done.summary.assertions:
    print("ok   " if assertion.ok else "FAILS", assertion.name, assertion.text)
for event in done.events:
    if event["kind"] == "decision":
        print(f"{event['t']:6.2f} s {event['from']}: {event['action']} {event.get('condition', '')}")
print(f"the same as a file, for lfa run: {done.folder / 'scenario.toml'}")
