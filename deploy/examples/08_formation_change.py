"""Change the formation on the way: the mission asks for a column at 3 m; see when each follower's slot has swung."""

import numpy as np

from lfa.deploy.simulate import run

course = [
    "mission.leading.route_m=[[8.0, 0.0]]",
    "mission.leading.orientations=[{at_m = 3.0, side = 'column'}]",
    "mission.formation.heading_filter_m=0.36",
]
done = run("straight", robots=3, set=course)

asked_s = next(float(event["t"]) for event in done.events if event.get("by") == "mission")
print(f"{asked_s:.1f} s: the leader asks for a column")
for robot, errors in done.errors.items():
    moving = errors.t[errors.changing & (errors.t > asked_s)]
    print(f"robot {robot}: its slot moves until {moving.max():.1f} s, {moving.max() - asked_s:.1f} s after the request")
    after = np.abs(errors.bearing_asked[errors.t > moving.max() + 1.0])
    print(f"robot {robot}: then {np.degrees(after.max()):.1f} degrees at most off its commanded bearing")
picture = done.folder / "path.png"
done.figure("fig09_path_flow").savefig(picture)
print(f"drawn: {picture}")
