"""String stability (control.md 5.4): amplification of the leader's motion along a chain of 100 followers.

The chain is causal: one run of 100 followers gives the ratios at 3, 10, 50 and 100. Longitudinal: a sine on the
leader's speed, the worst of several frequencies. Lateral: a sum of small sines on its heading, one run per mode.
"""

from __future__ import annotations

from cmath import exp
from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from math import ceil, cos, hypot, pi, sin, sqrt

from msgspec import Struct

from lfa.agents.config import CONTROL_PERIOD_S, Gains
from lfa.agents.formation.formation import slots_of
from lfa.agents.formation.pose_history import PoseHistory
from lfa.deploy.bench.harness.chain import Chain, ChainLink, Setup
from lfa.deploy.bench.harness.leader_trajectories import Leader, figure_eight
from lfa.deploy.bench.harness.rows import Case, Quantity, Rule
from lfa.protocol.geometry import Twist
from lfa.protocol.messages.team import Slot
from lfa.protocol.mission import FormationSpec, Side

PLACES = (3, 10, 50, 100)
SLOW_RADPS, FAST_RADPS = (0.2, 0.5), (1.0, 2.0, 4.0, 8.0)
SLOW_FOLLOWERS = 10
"""Number of followers for the slow sines, which take the most time; |G| grows with frequency in every scheme.

The worst hop is taken over the same number of followers, since an amplifying chain saturates further back.
"""
PERIODS = 8
MEASURE_S_MAX = 100.0
"""Maximum measuring time [s]; three periods at 0.2 rad/s."""
CRUISE_MPS = 0.5
RAMP_MPS2 = 0.4
SETTLE_S = 10.0
SEPARATION_M = 1.2


class Scheme(Struct, frozen=True):
    """One row of section 5.4, with the reference ratios at N = 3, 10, 50, 100 and of the worst hop; None: saturated."""

    name: str
    mode: str
    delay_s: float
    latency_s: float
    jitter_s: float
    loss: float
    reference: tuple[float | None, ...]
    good: tuple[float | None, ...] = (None,) * 5
    """Bars of section 6 for the same five ratios; None where there is none."""
    gains: Gains = Gains()
    extrapolation_max_s: float = 0.5
    headway_s: float = 0.02
    """Delay [s] with which a hop passes on its predecessor's motion."""
    slow_radps: tuple[float, ...] = SLOW_RADPS
    fast_radps: tuple[float, ...] = FAST_RADPS


_BUFFER = (None, 1.005, 1.01, 1.02, None)
#      name                         mode        buffer latency jitter loss   N=3     10      50      100     hop
SCHEMES = (
    # Without feed-forward |G| is 1 only for the slowest waves and below 1 otherwise. Its lag requires m > 0.5.
    Scheme("pose, no feed-forward", "pose",     0.0,   0.02,   0.0,   0.0,  (1.00,   1.00,   0.999,  0.998,  1.000),
           gains=Gains(feed_forward=0.0, m_mps=0.65, b_m=0.3), extrapolation_max_s=0.0, headway_s=0.8, slow_radps=(),
           fast_radps=(0.02,)),
    Scheme("pose, DR, 20 ms",       "pose",     0.0,   0.02,   0.0,   0.0,  (1.75,   3.7,    None,   None,   1.21)),
    Scheme("pose, DR, 100 ms 20 %", "pose",     0.0,   0.10,   0.0,   0.2,  (2.34,   5.8,    None,   None,   1.33)),
    Scheme("vel, DR, 20 ms",        "velocity", 0.0,   0.02,   0.0,   0.0,  (1.09,   1.34,   3.2,    5.8,    1.030),
           (None, None, None, None, 1.035)),
    Scheme("vel, DR, 20 ms 20 %",   "velocity", 0.0,   0.02,   0.0,   0.2,  (1.11,   1.42,   3.8,    None,   1.044)),
    Scheme("vel, DR, 100 ms",       "velocity", 0.0,   0.10,   0.0,   0.0,  (1.51,   3.2,    None,   None,   1.148)),
    Scheme("vel, 40 ms",            "velocity", 0.04,  0.02,   0.0,   0.0,  (1.0004, 1.0002, 1.0003, 1.0003, 1.0002),
           _BUFFER),
    Scheme("vel, 40 ms 10 %",       "velocity", 0.04,  0.02,   0.0,   0.1,  (1.008,  1.017,  1.085,  1.173,  1.006)),
    Scheme("vel, 80 ms 5 %",        "velocity", 0.08,  0.02,   0.0,   0.05, (1.0000, 1.0001, 1.0001, 1.0001, 1.0012),
           _BUFFER),
    Scheme("vel, 80 ms 20 %",       "velocity", 0.08,  0.02,   0.0,   0.2,  (1.0008, 1.003,  1.007,  1.012,  1.003),
           _BUFFER),
    Scheme("vel, 220 ms 20 %",      "velocity", 0.22,  0.10,   0.04,  0.2,  (1.0001, 1.0001, 1.0001, 1.0001, 1.003),
           _BUFFER),
    Scheme("pose, 220 ms 10 %",     "pose",     0.22,  0.10,   0.04,  0.1,  (1.0001, 1.0000, 0.9999, 1.0000, 1.003),
           _BUFFER),
    Scheme("pose, 220 ms 20 %",     "pose",     0.22,  0.10,   0.04,  0.2,  (1.0017, 1.0013, 1.0011, 1.0011, 1.016),
           _BUFFER),
    Scheme("pose, 60 ms",           "pose",     0.06,  0.02,   0.0,   0.0,  (1.0004, 1.0003, 1.0003, 1.0004, 1.0002),
           _BUFFER),
    Scheme("pose, 60 ms 10 %",      "pose",     0.06,  0.02,   0.0,   0.1,  (1.010,  1.013,  1.046,  1.12,   1.019)),
)  # fmt: skip

HEADING_RADPS = (0.2, 0.4, 0.8, 1.5, 3.0)
WAVE_S = 20.0 * pi
"""Measuring time [s]; a whole number of periods of each frequency in `HEADING_RADPS`."""
HOP_SPARE = 1.05
"""Settling time of a wave per hop, as a multiple of the time to travel the distance k |cos phi| of a hop."""


class Mode(Struct, frozen=True):
    """A lateral row of section 5.4, with reference amplitude ratios by number of hops, one per frequency."""

    name: str
    side: Side
    filter_m: float
    trace: bool
    after: dict[int, tuple[float | None, ...]]
    """Reference ratios by number of hops; None if the reference chain is saturated."""
    amplitude_rad: float = 0.012
    """Amplitude [rad] of each sine of the leader's heading; small, so that the sines do not interact."""


MODES = (
    Mode("column L=k/2", "column", 0.6, False,
         {3: (1.00, 1.002, 1.02, 1.07, 1.08), 100: (1.006, 1.08, 1.98, None, None)}, 0.001),
    Mode("column L=0.6k", "column", 0.72, False,
         {3: (0.94, 0.80, 0.57, 0.41, 0.33), 100: (0.11, 0.001, 0.0, 0.0, 0.0)}),
    Mode("zigzag L=0.30", "zigzag", 0.30, False,
         {3: (1.00, 1.00, 1.00, 0.99, 0.90), 100: (1.00, 1.001, 0.995, 0.75, 0.04)}),
    Mode("zigzag L=0.36", "zigzag", 0.36, False,
         {3: (0.98, 0.94, 0.80, 0.57, 0.34), 100: (0.57, 0.11, 0.001, 0.0, 0.0)}),
    Mode("zigzag L=0.60", "zigzag", 0.60, False,
         {3: (0.92, 0.73, 0.38, 0.12, 0.02), 100: (0.06, 0.0, 0.0, 0.0, 0.0)}),
    Mode("trace", "column", 0.0, True,
         {3: (1.000, 1.000, 1.002, 1.010, 1.04), 100: (1.000, 1.003, 1.015, 1.075, 1.25)}),
    Mode("column rigid", "column", 0.0, False, {3: (1.37, 2.7, 10.0)}, 0.003),
    Mode("zigzag rigid", "zigzag", 0.0, False, {3: (1.09, 1.37, 2.7)}, 0.003),
)  # fmt: skip

TRACE_LAP_M = 20.0
TRACE_FOLLOWERS = 100


def cases() -> list[Case]:
    """Return the lateral, longitudinal and path-tracking cases."""
    return [
        *(_lateral(mode) for mode in MODES),
        *(_longitudinal(scheme) for scheme in SCHEMES),
        _trace_path("20 ms", ChainLink(), 0.04),
        _trace_path("100 ms + 40 ms, 10 %", ChainLink(0.1, 0.04, 0.1), 0.22),
    ]


def _longitudinal(scheme: Scheme) -> Case:
    names = [*(f"N={n}" for n in PLACES), "worst hop"]
    # With packet loss the reference is one random sample; a smaller amplification also passes.
    rule: Rule = "no worse" if scheme.loss > 0.0 else "near"
    quantities = tuple(
        Quantity(name, "ratio", good) if good is not None else Quantity(name, "ratio", reference, rule)
        for name, reference, good in zip(names, scheme.reference, scheme.good, strict=True)
    )
    return Case(f"string/{scheme.name}", quantities, partial(longitudinal, scheme))


def longitudinal(scheme: Scheme, places: Sequence[int] = PLACES) -> tuple[float, ...]:
    """Return the speed amplification at each place and that of the worst hop, each at its worst frequency.

    Amplification is the rms deviation of the speed over that of the leader, or of the predecessor for a hop.
    """
    runs = [(omega, min(SLOW_FOLLOWERS, places[-1])) for omega in scheme.slow_radps]
    runs += [(omega, places[-1]) for omega in scheme.fast_radps]
    worst, worst_hop = [0.0] * len(places), 0.0
    for omega, followers in runs:
        deviations = speed_wave(scheme, omega, followers)
        for index, place in enumerate(places):
            if place <= followers:
                worst[index] = max(worst[index], deviations[place] / deviations[0])
        worst_hop = max(worst_hop, *(b / a for a, b in pairwise(deviations[: SLOW_FOLLOWERS + 1])))
    return *worst, worst_hop


def speed_wave(scheme: Scheme, omega: float, followers: int) -> list[float]:
    """Return the rms speed deviation [m/s] of each robot, leader first, for a sine of `omega` [rad/s] on its speed."""
    slots = slots_of(FormationSpec(side="column", separation_m=SEPARATION_M), range(2, followers + 2))
    chain = Chain(
        Setup(
            slots,
            gains=scheme.gains,
            mode=scheme.mode,
            delay_s=scheme.delay_s,
            trace=True,
            link=ChainLink(scheme.latency_s, scheme.jitter_s, scheme.loss),
            extrapolation_max_s=scheme.extrapolation_max_s,
            judged=False,
        )
    )
    amplitude, period = min(0.1, 0.5 / omega), 2.0 * pi / omega
    periods = min(PERIODS, max(1, int(MEASURE_S_MAX / period)))
    begin = ceil((SETTLE_S + followers * max(scheme.delay_s, scheme.headway_s)) / CONTROL_PERIOD_S)
    steps = round(periods * period / CONTROL_PERIOD_S)
    sums = [[0.0, 0.0] for _ in range(followers + 1)]
    for step in range(begin + steps):
        t = step * CONTROL_PERIOD_S
        wave = amplitude * sin(omega * t) if t > 2.0 else 0.0
        chain.step(Twist(min(CRUISE_MPS, RAMP_MPS2 * t) + wave, 0.0))
        if step >= begin:
            _add(sums[0], chain.leader_twist.linear_x)
            for index, robot in enumerate(chain.robots):
                _add(sums[index + 1], robot.twist.linear_x)
    return [sqrt(max(0.0, square / steps - (total / steps) ** 2)) for total, square in sums]


def _add(sums: list[float], value: float) -> None:
    sums[0] += value
    sums[1] += value * value


# --- lateral ------------------------------------------------------------------------------------------------------


def _lateral(mode: Mode) -> Case:
    quantities = tuple(
        Quantity(f"N={n} {omega:g} rad/s", "ratio", reference, "near")
        for n, references in mode.after.items()
        for omega, reference in zip(HEADING_RADPS, references, strict=False)
    )
    return Case(f"lateral/{mode.name}", quantities, partial(lateral, mode))


def lateral(mode: Mode) -> tuple[float, ...]:
    """Return the heading amplitude at each place over the leader's, for each frequency."""
    followers = max(mode.after)
    count = len(next(iter(mode.after.values())))
    omegas = HEADING_RADPS[:count]
    slots = slots_of(FormationSpec(side=mode.side, separation_m=SEPARATION_M), range(2, followers + 2))
    chain = Chain(Setup(slots, trace=mode.trace, heading_filter_m=mode.filter_m, judged=False))
    hop_s = HOP_SPARE * abs(SEPARATION_M * cos(slots[0].phi)) / CRUISE_MPS
    begin = round((SETTLE_S + hop_s * followers) / CONTROL_PERIOD_S)
    steps = round(WAVE_S / CONTROL_PERIOD_S)
    watched = (0, *mode.after)
    waves = {place: [0j] * count for place in watched}
    for step in range(begin + steps):
        t = step * CONTROL_PERIOD_S
        turn = sum(mode.amplitude_rad * omega * cos(omega * t) for omega in omegas)
        chain.step(Twist(CRUISE_MPS, turn))
        if step >= begin:
            for place in watched:
                theta = (chain.leader_pose if place == 0 else chain.robots[place - 1].pose).theta
                for index, omega in enumerate(omegas):
                    waves[place][index] += theta * exp(-1j * omega * t)
    return tuple(abs(waves[place][index]) / abs(waves[0][index]) for place in mode.after for index in range(count))


# --- a hundred robots on one path ---------------------------------------------------------------------------------


def _trace_path(name: str, link: ChainLink, delay_s: float) -> Case:
    quantities = tuple(
        Quantity(f"robot {n} off the leader's path", "mm", 8.0 if n == TRACE_FOLLOWERS else None) for n in PLACES
    )
    return Case(f"trace/figure_eight {name}", quantities, partial(trace_path, link, delay_s))


def trace_path(link: ChainLink, delay_s: float) -> tuple[float, ...]:
    """Return the rms distance [mm] of the robots at `PLACES` from the leader's path, over one lap of a figure-eight."""
    slots: tuple[Slot, ...] = slots_of(FormationSpec(side="column"), range(2, TRACE_FOLLOWERS + 2))
    setup = Setup(slots, trace=True, delay_s=delay_s, link=link, judged=False)
    chain = Chain(setup)
    leader = Leader(figure_eight(TRACE_LAP_M), (), setup.limits)
    # The last robot starts 120 m behind on a straight line, and must have reached the curve before it is measured.
    way_m = TRACE_FOLLOWERS * SEPARATION_M + 2.0 * TRACE_LAP_M
    path = PoseHistory(2.0 * way_m)
    sums, count = [0.0] * len(PLACES), 0
    while leader.s < way_m:
        path.add(chain.leader_pose)
        chain.step(leader.step(CONTROL_PERIOD_S))
        if leader.s > way_m - TRACE_LAP_M:
            count += 1
            for index, place in enumerate(PLACES):
                pose = chain.robots[place - 1].pose
                sums[index] += _off(path, pose.x, pose.y, path.travelled_m - place * SEPARATION_M) ** 2
    return tuple(1e3 * sqrt(total / count) for total in sums)


def _off(path: PoseHistory, x: float, y: float, near_s: float) -> float:
    """Return the distance [m] of a point from `path`; the search starts at arc length `near_s` [m]."""
    s = near_s
    for _ in range(20):
        point = path.at(s)
        along = cos(point.theta) * (x - point.x) + sin(point.theta) * (y - point.y)
        s += along
        if abs(along) < 1e-7:
            break
    point = path.at(s)
    return hypot(x - point.x, y - point.y)
