"""A policy for one robot of the team, found by chance: its episodes, their rewards, and the best that was found."""

import numpy as np

from lfa.deploy.learn.observation import FIELDS
from lfa.deploy.simulate import environment

ROBOT = "robot3"
SLOT = FIELDS.index("slot_x")
env = environment("straight", [3], robots=3, set=["time_limit_s=8"])  # robots 1 and 2 drive as always


def policy(seen: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Return forward speed [m/s] and yaw rate [rad/s]: as the robot drives, corrected by where its slot is."""
    ahead_m, left_m = seen[SLOT : SLOT + 2]
    return np.array([0.5 + gains[0] * ahead_m, gains[1] * left_m], np.float32)


def episode(gains: np.ndarray) -> float:
    """Return the sum of the rewards: minus the distance [m] to the slot at each step, minus 1 for each contact."""
    (seen, _), total = env.reset(seed=1), 0.0
    while env.agents:
        seen, rewards, *_ = env.step({ROBOT: policy(seen[ROBOT], gains)})
        total += rewards[ROBOT]
    return total


chance = np.random.default_rng(7)
best, worth = np.zeros(2), episode(np.zeros(2))
print(f"gains 0.00, 0.00: {worth:.2f}")
for _ in range(6):
    tried = best + chance.uniform(0.0, 1.0, 2)
    found = episode(tried)
    print(f"gains {tried[0]:.2f}, {tried[1]:.2f}: {found:.2f}")
    if found > worth:
        best, worth = tried, found
print(f"best: {best[0]:.2f}, {best[1]:.2f} with {worth:.2f}")
