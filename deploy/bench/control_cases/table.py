"""Table of control.md section 6 on the bare chain: one leader, three followers, paths x formations x conditions."""

from __future__ import annotations

from functools import partial
from math import cos, pi, sin, sqrt
from random import Random
from time import process_time

from lfa.agents.config import CONTROL_PERIOD_S, SHARP, Gains
from lfa.agents.formation.formation import slots_of
from lfa.deploy.bench.harness.chain import Blur, Chain, ChainLink, Setup, in_slots
from lfa.deploy.bench.harness.leader_trajectories import Curvature, Leader, circle, figure_eight, straight
from lfa.deploy.bench.harness.rows import Case, Quantity
from lfa.protocol.geometry import Pose2D, Twist, along_arc, distance
from lfa.protocol.messages.consensus import NO_TERM, Role
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import PoseStamped, Slot
from lfa.protocol.mission import FormationSpec, Limits, Side

FOLLOWERS = (2, 3, 4)
RUN_S = 120.0
SETTLED_M = 0.05
START_M, START_RAD = 0.15, 0.2
RESTING = 1e-3
"""Maximum speed [m/s, rad/s] of a robot at rest."""
DEGREES = 180.0 / pi
STEPS_TIMED, TRIES = 4000, 5

PATHS: dict[str, Curvature] = {"straight": straight, "circle": circle(4.0), "figure_eight": figure_eight(60.0)}
FORMATIONS: dict[str, tuple[Side, bool]] = {
    "left": ("left", False),
    "zigzag": ("zigzag", False),
    "trace": ("column", True),
}
SLOW_NETWORK = ChainLink(delay_s=0.1, jitter_s=0.04, loss=0.1)
NOISE_FILTER_M = 0.36
"""Heading filter length [m]: 0.6 k |cos phi| of the 60 degree slots; rigid slots amplify noise in the chain (5.4)."""

#   condition   settle F1, F3 [s]   distance [mm]: straight and circle, eight   bearing, heading [deg]
BARS: dict[str, tuple[float, float, float, float, float | None, float]] = {
    "clean": (4.0, 10.0, 0.01, 2.0, 0.2, 0.3),
    "network": (4.5, 13.0, 6.0, 6.0, 0.5, 4.5),
    "noise": (4.0, 10.0, 3.0, 3.0, None, 1.5),
}


def cases() -> list[Case]:
    """Return the cases of the grid, of the events, and of the time per step."""
    grid = [_steady(condition, path, formation) for condition in BARS for path in PATHS for formation in FORMATIONS]
    return [*grid, *_events(), _step_time()]


def _steady(condition: str, path: str, formation: str) -> Case:
    settle_1, settle_3, on_bends, on_eight, bearing, heading = BARS[condition]
    quantities = (
        Quantity("settle F1", "s", settle_1),
        Quantity("settle F3", "s", settle_3),
        Quantity("distance rms", "mm", on_eight if path == "figure_eight" else on_bends),
        Quantity("bearing rms", "deg", bearing),
        Quantity("heading rms", "deg", heading),
    )
    return Case(f"{condition}/{path}/{formation}", quantities, partial(steady, condition, path, formation))


def slots(side: Side, followers: int = len(FOLLOWERS)) -> tuple[Slot, ...]:
    """Return the slots of the followers, from robot 2 on, for a formation side."""
    return slots_of(FormationSpec(side=side), range(2, followers + 2))


def setup_of(condition: str, formation: str, seed: int = 1) -> Setup:
    """Return the setup of the chain for one row of the table."""
    side, on_trace = FORMATIONS[formation]
    link = SLOW_NETWORK if condition == "network" else ChainLink()
    noisy = condition == "noise"
    return Setup(
        slots(side),
        trace=on_trace,
        link=link,
        blur=Blur() if noisy else None,
        heading_filter_m=NOISE_FILTER_M if noisy else 0.0,
        seed=seed,
    )


def steady(condition: str, path: str, formation: str, setup: Setup | None = None) -> tuple[float, ...]:
    """Return (settle F1, F3 [s], distance rms [mm], bearing, heading rms [deg]); rms of the worst follower.

    A follower has settled when it stays within 5 cm of its slot; the rms values cover the second half of the run.
    """
    setup = setup_of(condition, formation) if setup is None else setup
    chain = Chain(setup, astray(setup.slots, setup.seed))
    leader = Leader(PATHS[path], () if setup.trace else setup.slots, setup.limits)
    count = len(setup.slots)
    settle = [0.0] * count
    sums = [[0.0, 0.0, 0.0] for _ in range(count)]
    steps = round(RUN_S / CONTROL_PERIOD_S)
    for step in range(steps):
        chain.step(leader.step(CONTROL_PERIOD_S))
        for index in range(count):
            error = chain.errors(index)
            if error.slot_m > SETTLED_M:
                settle[index] = chain.time_s
            if step >= steps // 2:
                for place, value in enumerate((error.distance_m, error.bearing_rad, error.heading_rad)):
                    sums[index][place] += value * value
    rms = [max(sqrt(s[place] / (steps - steps // 2)) for s in sums) for place in range(3)]
    return settle[0], settle[-1], 1e3 * rms[0], DEGREES * rms[1], DEGREES * rms[2]


def astray(followers: tuple[Slot, ...], seed: int) -> list[Pose2D]:
    """Return start poses with each follower 0.15 m and 0.2 rad off its slot, in random directions."""
    chance = Random(seed)
    starts = [Pose2D()]
    for pose in in_slots(Pose2D(), followers):
        way = chance.uniform(-pi, pi)
        x, y = pose.x + START_M * cos(way), pose.y + START_M * sin(way)
        starts.append(Pose2D(x, y, chance.choice((-START_RAD, START_RAD))))
    return starts


# --- starts, stops and changes ------------------------------------------------------------------------------------


def _events() -> list[Case]:
    return [
        Case("start/default", _START, partial(paper_start, Gains())),
        Case("start/sharp", _start_bars(3.2), partial(paper_start, SHARP)),
        Case("goal/left", (Quantity("at rest F1", "s", 1.6), Quantity("at rest F3", "s", 4.8)), goal),
        *(Case(f"change/{first} to {second}", _CHANGE, partial(change, first, second)) for first, second in _CHANGES),
        Case("predecessor/closing over a dead robot", _CLOSING, closing),
        *(
            Case(f"clocks/{name}", _CLOCKS, partial(clocks, offset_s, drift))
            for name, offset_s, drift in (("3 s", 3.0, 0.0), ("10 days", 864000.0, 0.0), ("200 ppm", 0.0, 200e-6))
        ),
    ]


def _start_bars(first_s: float) -> tuple[Quantity, ...]:
    return (
        Quantity("F1 to 5 cm", "s", first_s),
        Quantity("F3 to 5 cm", "s"),
        Quantity("largest distance error", "m", 1.2),
    )


_START = _start_bars(4.5)
_CHANGES: tuple[tuple[Side, Side], ...] = (("left", "right"), ("right", "column"))
_CHANGE = (
    Quantity("recovered F1", "s", 8.0),
    Quantity("recovered F3", "s", 20.0),
    Quantity("least separation", "m", 0.45, "at least"),
    Quantity("largest acceleration", "of max", 1.0),
)
_CLOSING = (Quantity("recovered", "s", 6.5), Quantity("least separation", "m", 0.45, "at least"))
_CLOCKS = (
    Quantity("distance rms", "mm", 2.0),
    Quantity("bearing rms", "deg", 0.2),
    Quantity("heading rms", "deg", 0.3),
)


def paper_start(gains: Gains) -> tuple[float, ...]:
    """Return (settle F1, F3 [s], largest distance error [m]) of a start at rest with all robots at (0, 0, 0).

    The slots are to the left.
    """
    setup = Setup(slots("left"), gains=gains)
    chain = Chain(setup, [Pose2D()] * 4)
    leader = Leader(straight, setup.slots, setup.limits)
    settle, worst = [0.0, 0.0, 0.0], 0.0
    for _ in range(1500):
        chain.step(leader.step(CONTROL_PERIOD_S))
        for index in range(3):
            error = chain.errors(index)
            worst = max(worst, abs(error.distance_m))
            if abs(error.slot_m) > SETTLED_M:
                settle[index] = chain.time_s
    return settle[0], settle[2], worst


def goal() -> tuple[float, float]:
    """Return the times [s] from the leader's standstill until F1 and F3 stay at rest."""
    setup = Setup(slots("left"))
    chain = Chain(setup)
    leader = Leader(straight, setup.slots, setup.limits, stop_at_m=10.0)
    last = [0.0] * 4
    for _ in range(2000):
        chain.step(leader.step(CONTROL_PERIOD_S))
        for place, twist in enumerate([chain.leader_twist, *(robot.twist for robot in chain.robots)]):
            if max(abs(twist.linear_x), abs(twist.angular_z)) > RESTING:
                last[place] = chain.time_s
    return last[1] - last[0], last[3] - last[0]


def change(first: Side, second: Side) -> tuple[float, ...]:
    """Change the formation at cruise speed; return (recovered F1, F3 [s], least separation [m], largest acceleration).

    A follower has recovered when it stays within 5 cm of its new slot. The acceleration is a fraction of the limit.
    """
    setup = Setup(slots(first))
    chain = Chain(setup)
    leader = Leader(straight, setup.slots, setup.limits)
    for _ in range(500):
        chain.step(leader.step(CONTROL_PERIOD_S))
    for robot, slot in zip(chain.robots, slots(second), strict=True):
        robot.slot = slot
    begun, recovered, least, strain = chain.time_s, [0.0] * 3, 99.0, 0.0
    for _ in range(1500):
        before = [robot.twist for robot in chain.robots]
        poses = [chain.leader_pose, *(robot.pose for robot in chain.robots)]
        chain.step(leader.step(CONTROL_PERIOD_S))
        strain = max(strain, *(_strain(setup.limits, a, b.twist) for a, b in zip(before, chain.robots, strict=True)))
        least = min(least, *(distance(a, b) for n, a in enumerate(poses) for b in poses[:n]))
        for index, robot in enumerate(chain.robots):
            end = in_slots(poses[index], (robot.slot,))[0]
            if distance(end, poses[index + 1]) > SETTLED_M:
                recovered[index] = chain.time_s - begun
    return recovered[0], recovered[2], least, strain


def _strain(limits: Limits, before: Twist, after: Twist) -> float:
    """Return the largest acceleration of a step as a fraction of the drive's limit, rounded to 9 decimals."""
    linear = abs(after.linear_x - before.linear_x) / (limits.a_max_mps2 * CONTROL_PERIOD_S)
    angular = abs(after.angular_z - before.angular_z) / (limits.alpha_max_radps2 * CONTROL_PERIOD_S)
    return round(max(linear, angular), 9)


def closing() -> tuple[float, float]:
    """Remove the first of two followers, so that the second takes its place, 1.2 m ahead.

    Return the time [s] until it stays within 5 cm of the new slot, and the least separation [m].
    """
    setup = Setup(slots("left", 2))
    chain = Chain(setup)
    leader = Leader(straight, setup.slots, setup.limits)
    for _ in range(500):
        chain.step(leader.step(CONTROL_PERIOD_S))
    gone = chain.lose(0)
    heir = chain.robots[0]
    recovered, least = 0.0, 99.0
    for _ in range(800):
        place = in_slots(chain.leader_pose, (heir.slot,))[0]
        if distance(place, heir.pose) > SETTLED_M:
            recovered = chain.time_s - 500 * CONTROL_PERIOD_S
        least = min(least, distance(chain.leader_pose, heir.pose), distance(gone.pose, heir.pose))
        chain.step(leader.step(CONTROL_PERIOD_S))
    return recovered, least


def clocks(offset_s: float, drift: float) -> tuple[float, ...]:
    """Return the steady errors on the figure-eight, left formation, with different clocks of neighbouring robots."""
    setup = Setup(slots("left"), clock_offset_s=offset_s, clock_drift=drift)
    return steady("clean", "figure_eight", "left", setup)[2:]


def _step_time() -> Case:
    quantity = Quantity("one step of one robot", "us", 60.0)
    return Case("time", (quantity,), step_time)


def step_time() -> tuple[float]:
    """Return the time [us] of one follower step: receive a message, estimate the predecessor, compute a command.

    The value is the least of `TRIES` means over `STEPS_TIMED` steps, in processor time.
    """
    robot = Chain(Setup(slots("left", 1))).robots[0]
    twist = Twist(0.5, 0.1)
    best = float("inf")
    for attempt in range(TRIES):
        messages, poses = [], []
        for n in range(STEPS_TIMED):
            at = (attempt * STEPS_TIMED + n) * CONTROL_PERIOD_S
            pose = along_arc(Pose2D(), twist, at)
            header = Header("robot1", 1, n, at)
            messages.append(PoseStamped(header, pose.x, pose.y, 0.0, pose.theta, twist, 0.0, Role.LEADER, NO_TERM))
            poses.append((at, in_slots(pose, (robot.slot,))[0]))
        since = process_time()
        for message, (at, pose) in zip(messages, poses, strict=True):
            robot.predecessor.heard(message, at)
            robot.follower.step(robot.predecessor.at(at), robot.slot, pose, twist, CONTROL_PERIOD_S)
        best = min(best, (process_time() - since) / STEPS_TIMED)
    return (1e6 * best,)
