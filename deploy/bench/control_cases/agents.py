"""Control cases with complete agents, codec, world and lease, in virtual time or as processes.

Three rows of the string stability table with ten complete followers must agree with the bare chain to 1 %. The
scenarios straight, circle and figure_eight must reach the bars of control.md section 6: the "good" bars simulated, the
"must" bars as processes.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from math import hypot, pi, sin, sqrt
from pathlib import Path

from lfa.agents.agent import Agent
from lfa.agents.leading.path_follower import PathFollower
from lfa.deploy.bench.control_cases.string_stability import (
    CRUISE_MPS,
    RAMP_MPS2,
    SCHEMES,
    SEPARATION_M,
    Scheme,
    speed_wave,
)
from lfa.deploy.bench.control_cases.table import DEGREES
from lfa.deploy.bench.harness.rows import Case, Quantity
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import Following, FormationSpec, Leading, Mission
from lfa.protocol.node import Node
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.transport.link_model import Radio
from lfa.protocol.witness import Witness
from lfa.world.description.load import Lidar, Scenario, WorldSpec, load
from lfa.world.physics.kinematics import Kinematic
from lfa.world.simulator import Simulator
from lfa.world.virtual_time import LocalClock
from lfa.world.world import World

FLEET = "bench"
FOLLOWERS = 10
OMEGA_RADPS = 2.0
PERIODS = 8
BEGIN_S = 5.0
"""Time [s] at which the leader starts to move; the chain is complete by then."""
SETTLED_S = 20.0
"""Time [s] after `BEGIN_S` at which the wave has reached the last robot."""
CLOCKS_BEGIN_S, CLOCKS_END_S = 25.0, 40.0
REPEATED = ("vel, 40 ms", "vel, 80 ms 5 %", "vel, 80 ms 20 %")

SCENARIOS = ("straight", "circle", "figure_eight")
RUN_S_MAX = 900.0

#                 distance rms [mm]: straight and circle, eight   bearing, heading [deg]
GOOD, MUST = (1.0, 2.0, 0.2, 0.3), (5.0, 10.0, 1.0, 2.0)


def cases() -> list[Case]:
    """Return the cases that run in virtual time."""
    quantities = (Quantity(f"N={FOLLOWERS} over the bare chain", "ratio", 1.0, "same"),)
    repeated = [
        Case(f"agents/{scheme.name}", quantities, partial(against_bare, scheme))
        for scheme in SCHEMES
        if scheme.name in REPEATED
    ]
    clocks = Case("agents/clocks 3 s, 10 days, 200 ppm", (Quantity("distance rms", "mm", 1.0),), clock_errors)
    return [*repeated, clocks, *(_scenario("simulated", "sim", name, GOOD) for name in SCENARIOS)]


def process_cases() -> list[Case]:
    """Return the cases that run as processes on this machine, in real time."""
    return [_scenario("processes", "run", name, MUST) for name in SCENARIOS]


def against_bare(scheme: Scheme) -> tuple[float]:
    """Return the amplification of ten complete followers over that of ten bare ones, for a sine of the leader's speed.

    Both are the speed deviation of the last follower over that of the leader.
    """
    bare = speed_wave(scheme, OMEGA_RADPS, FOLLOWERS)
    whole = _whole(scheme)
    return ((whole[FOLLOWERS] / whole[0]) / (bare[FOLLOWERS] / bare[0]),)


class Waving(PathFollower):
    """Path follower of a leader that drives straight ahead with a sine on its speed."""

    def __init__(self, mission: Mission, now: Callable[[], float]) -> None:
        super().__init__(mission.leading, mission.limits)
        self._now = now

    def step(self, pose: Pose2D, twist: Twist, slots: Sequence[Slot], speed_max_mps: float) -> Twist:
        self.track(pose)
        t = self._now() - BEGIN_S
        wave = 0.1 * sin(OMEGA_RADPS * t) if t > 2.0 else 0.0
        return Twist(max(0.0, min(CRUISE_MPS, RAMP_MPS2 * t)) + wave, 0.0)


def _whole(scheme: Scheme) -> list[float]:
    """Return the rms deviation [m/s] of each robot's true speed, the leader first."""
    mission = Mission(
        robots=tuple(range(1, FOLLOWERS + 2)),
        profile="wifi",
        formation=FormationSpec(separation_m=SEPARATION_M, side="column"),
        following=Following(
            observer="pose" if scheme.mode == "pose" else "velocity", trace=True, delay_s=scheme.delay_s
        ),
        leading=Leading(route_m=((0.0, 0.0), (500.0, 0.0))),
    )
    scenario = Scenario("A wave along ten robots", mission, 1e6, WorldSpec(lidar=Lidar(beams=16, rate_hz=1.0)))
    simulator = Simulator(Radio(delay_s=scheme.latency_s, jitter_s=scheme.jitter_s, loss=scheme.loss), seed=1)
    period = 2.0 * pi / OMEGA_RADPS
    begin, end = BEGIN_S + SETTLED_S, BEGIN_S + SETTLED_S + PERIODS * period
    speeds: list[list[float]] = [[] for _ in mission.robots]

    def hear(now: float, _key: str, _payload: bytes, message: Message) -> None:
        if isinstance(message, Truth) and begin <= now < end:
            for robot in message.robots:
                speeds[robot.id - 1].append(robot.linear_x)

    simulator.taps.append(hear)
    agents = _gather(simulator, scenario, {})
    simulator.at(1.0, lambda: _let_wave(agents[0], Waving(mission, lambda: simulator.now)))
    simulator.run(end + 0.1)
    return [_deviation(values) for values in speeds]


def _gather(simulator: Simulator, scenario: Scenario, clocks: dict[str, LocalClock]) -> list[Agent]:
    """Add the world, witness and agents of `scenario` to the simulator, each with its clock; return the agents."""
    agents = [Agent(robot, 1, FLEET, 1) for robot in scenario.mission.robots]
    nodes: list[Node] = [World(FLEET, scenario, 1, 1, start_at=0.0, bodies=Kinematic), Witness(FLEET, 1, 1), *agents]
    for node in nodes:
        journal = Journal(None, Heading(JOURNAL_VERSION, node.name, 1, 1, {}))
        simulator.add(node, journal, clocks.get(node.name))
    return agents


CLOCKS = {
    "robot2": LocalClock(3.0, 1.0),
    "robot3": LocalClock(864000.0, 1.0 + 200e-6),
    "robot4": LocalClock(0.0, 1.0 - 200e-6),
}


def clock_errors() -> tuple[float]:
    """Return the distance rms [mm] of the worst follower on the circle, with 20 ms delay and one clock per host."""
    simulator = Simulator(Radio(delay_s=0.02, jitter_s=0.001), seed=1)
    scenario = load("circle")
    sums, count = [0.0, 0.0, 0.0], 0

    def hear(now: float, _key: str, _payload: bytes, message: Message) -> None:
        nonlocal count
        if isinstance(message, Truth) and now > CLOCKS_BEGIN_S:
            count += 1
            for index, (ahead, robot) in enumerate(pairwise(message.robots)):
                sums[index] += (hypot(robot.x - ahead.x, robot.y - ahead.y) - SEPARATION_M) ** 2

    simulator.taps.append(hear)
    _gather(simulator, scenario, CLOCKS)
    simulator.run(CLOCKS_END_S)
    return (1e3 * sqrt(max(sums) / count),)


def _let_wave(agent: Agent, lead: PathFollower) -> None:
    """Replace the path follower of an agent that has one, since no mission can specify a speed wave."""
    assert agent.core is not None
    agent.core.navigator.leading.lead = lead


def _deviation(values: list[float]) -> float:
    mean = sum(values) / len(values)
    return sqrt(sum((value - mean) ** 2 for value in values) / len(values))


# --- scenarios ----------------------------------------------------------------------------------------------------


def _scenario(how: str, command: str, name: str, bars: tuple[float, float, float, float]) -> Case:
    on_bends, on_eight, bearing, heading = bars
    quantities = (
        Quantity("distance rms", "mm", on_eight if name == "figure_eight" else on_bends),
        Quantity("bearing rms", "deg", bearing),
        Quantity("heading rms", "deg", heading),
        Quantity("settled last", "s"),
        Quantity("contacts", "", 0.0),
    )
    return Case(f"{how}/{name}", quantities, partial(scenario_errors, command, name))


def scenario_errors(command: str, name: str) -> tuple[float, ...]:
    """Run `lfa sim NAME` or `lfa run NAME`; return the worst follower's errors from summary.json, nan if it failed.

    The values are the rms of distance [mm], bearing [deg] and heading [deg], the settling time [s], and the number of
    contacts of all robots.
    """
    with tempfile.TemporaryDirectory(prefix="lfa-bench-") as folder:
        out = Path(folder) / "run"
        argv = [sys.executable, "-c", "from lfa.deploy.cli import main; main()", command, name]
        subprocess.run(
            [*argv, "--out", str(out), "--no-figures", "--json"],
            stdout=subprocess.DEVNULL,
            timeout=RUN_S_MAX,
            check=False,
        )
        summary = json.loads((out / "summary.json").read_bytes())
    if summary["outcome"] != "goal_reached":
        return (float("nan"),) * 5
    followers = [robot for robot in summary["robots"] if robot["distance_error_rms_m"] is not None]
    return (
        1e3 * max(robot["distance_error_rms_m"] for robot in followers),
        DEGREES * max(robot["bearing_error_rms_rad"] for robot in followers),
        DEGREES * max(robot["heading_error_rms_rad"] for robot in followers),
        max(robot["settled_after_s"] for robot in followers),
        float(sum(robot["contacts"] for robot in summary["robots"])),
    )
