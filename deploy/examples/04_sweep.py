"""Sweep: the same course for several gains and seeds, as one does in a notebook; a table, and a picture of it."""

from pathlib import Path
from statistics import mean

from matplotlib.figure import Figure

from lfa.deploy.simulate import run

GAINS_PER_S = (0.8, 1.5)
SEEDS = (1, 2)
COURSE = [
    "mission.leading.route_m=[[3.0, 0.0]]",
    "world.noise.localization_m=0.005",
    "world.vary.starts_m=0.3",
]

settled_s: dict[float, float] = {}
for gain in GAINS_PER_S:
    setting = [*COURSE, f"mission.following.gains.k_per_s={gain}"]
    runs = [run("straight", seed=seed, robots=2, set=setting) for seed in SEEDS]
    times = [done.errors[2].settled_after_s for done in runs]
    settled_s[gain] = mean(time for time in times if time is not None)
    print(f"K = {gain:.1f} 1/s: settled after {settled_s[gain]:.2f} s, mean of {len(runs)} runs")

figure = Figure(figsize=(4.0, 2.5), layout="constrained")
axes = figure.add_subplot(xlabel="gain K [1/s]", ylabel="settled after [s]")
axes.plot(list(settled_s), list(settled_s.values()), "o-")
figure.savefig(Path("sweep.png"))
print("drawn: sweep.png")
