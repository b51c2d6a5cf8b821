"""Steps a second that a learner gets on one core: of this team, of VMAS and of navground, on one scene in one run.

The scene is a column of robots with two wheels, without scanners, each driven straight on by the policy, ten steps a
simulated second. A step of this team holds what its robots do besides: lease, messages, gateways, estimators and a
rigid-body world at 50 Hz; VMAS and navground move discs. VMAS steps many copies at once, which is its strength: it is
measured with one and with `COPIES`. Both run in an environment of their own, which `make peers-learn` makes.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from time import process_time

import numpy as np

from lfa.deploy import simulate
from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.protocol.errors import Refused
from lfa.protocol.output import write_line

ROBOTS, STEP_S, SPEED_MPS, SPACING_M = 4, 0.1, 0.2, 1.0
STEPS, STEPS_VMAS, STEPS_NAVGROUND = 60, 200, 20_000
COPIES = 64
GROUPS = ("lfa", "VMAS", "navground")
PEERS = Path(__file__).resolve().parents[3] / ".peers" / "learn"


def run(as_json: bool, rows: str = "*") -> int:
    """Print the matching rows; return 0 if all hold, else 1. Raises Refused if no row can match."""
    chosen = [group for group in GROUPS if fnmatchcase(group, rows.partition("/")[0])]
    if not chosen:
        raise Refused(f"--rows {rows!r}: no row has such a name; they begin with {', '.join(GROUPS)}")
    return show(([one for one in some if fnmatchcase(one.name, rows)] for some in _rows(chosen)), as_json)


def _rows(chosen: list[str]) -> Iterator[list[BenchRow]]:
    steps = Quantity("steps per second of processor time", "1/s")
    if "lfa" in chosen:
        yield [row("lfa", steps, steps_of_team())]
    others = [group for group in chosen if group != "lfa"]
    if others and not (PEERS / ".installed").is_file():
        write_line(f"not measured: {', '.join(others)}: not installed here, make peers-learn does it", sys.stderr)
        return
    scene = (ROBOTS, STEP_S, SPEED_MPS, SPACING_M)
    if "VMAS" in chosen:
        at_once = Quantity(f"steps per second of processor time, {COPIES} copies at once", "1/s")
        yield [
            row("VMAS", steps, steps_of_peer("vmas_scene.py", *scene, STEPS_VMAS, 1)),
            row("VMAS", at_once, steps_of_peer("vmas_scene.py", *scene, STEPS_VMAS, COPIES)),
        ]
    if "navground" in chosen:
        yield [row("navground", steps, steps_of_peer("navground_scene.py", *scene, STEPS_NAVGROUND))]


def steps_of_team(steps: int = STEPS) -> float:
    """Return how many steps of the team's environment a second of processor time holds, from its first leader on."""
    environment = simulate.environment("straight", robots=ROBOTS, set=["world.lidar.beams=0"], step_s=STEP_S)
    environment.reset(seed=1)
    forward = np.array([SPEED_MPS, 0.0], np.float32)
    actions = dict.fromkeys(environment.agents, forward)
    for _ in range(round(1.0 / STEP_S)):
        environment.step(actions)
    began = process_time()
    for _ in range(steps):
        environment.step(actions)
    spent_s = process_time() - began
    environment.close()
    return steps / spent_s


def steps_of_peer(script: str, *arguments: float) -> float:
    """Return what a script beside this file prints, in the interpreter of the other simulators.

    Raises Refused if it fails.
    """
    words = [str(PEERS / "bin" / "python"), str(Path(__file__).with_name(script)), *map(str, arguments)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    try:
        return float(done.stdout.split()[-1])
    except (IndexError, ValueError):
        reason = (done.stderr.strip().splitlines() or ["nothing printed"])[-1]
        raise Refused(f"{script}: {reason}: make peers-learn must have installed what it needs") from None
