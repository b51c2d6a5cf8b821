"""Read a recorded run, given as the argument or made here: positions, errors and events as numpy arrays and lines."""

import sys
from collections import Counter
from pathlib import Path

import numpy as np

from lfa.deploy.simulate import read, run

if len(sys.argv) > 1:
    done = read(Path(sys.argv[1]))
else:
    made = run("straight", seed=7, robots=3, set=["mission.leading.route_m=[[3.0, 0.0]]"])
    done = read(made.folder)

print(f"{done.folder}: robots {done.robots}, {done.summary.mode}, seed {done.summary.seed}")
for robot, rows in done.truth.items():
    t, x, y, _theta, v, _omega = rows.T  # s, m, m, rad, m/s, rad/s in map
    way_m = float(np.hypot(np.diff(x), np.diff(y)).sum())
    print(f"robot {robot}: {t.size} poses, {way_m:.2f} m driven, fastest {v.max():.2f} m/s")
for robot, errors in done.errors.items():
    print(f"robot {robot}: distance error {1000.0 * np.abs(errors.distance).max():.0f} mm at most")
first, second = (done.truth[robot] for robot in done.robots[:2])
rows_of_both = min(len(first), len(second))
apart_m = np.hypot(*(first[:rows_of_both, 1:3] - second[:rows_of_both, 1:3]).T)
print(f"robots {done.robots[0]} and {done.robots[1]} were {apart_m.min():.2f} to {apart_m.max():.2f} m apart")
print("events:", dict(Counter(str(event["kind"]) for event in done.events)))
