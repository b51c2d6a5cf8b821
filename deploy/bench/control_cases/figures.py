"""Figures of the control bench: errors over time, amplification over frequency with the theory of control.md 5.1.

Fig. 11 (a)-(d) of the paper is drawn from a run of its scenario: `lfa sim paper_fig11`.
"""

from __future__ import annotations

from math import hypot, pi
from pathlib import Path

from lfa.agents.config import CONTROL_PERIOD_S
from lfa.deploy.bench.control_cases.string_stability import SCHEMES, speed_wave
from lfa.deploy.bench.control_cases.table import DEGREES, PATHS, astray, setup_of
from lfa.deploy.bench.harness.chain import Chain
from lfa.deploy.bench.harness.leader_trajectories import Leader

RUN_S = 60.0
FREQUENCIES_RADPS = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0)
HOPS = 3
DRAWN = {"vel, DR, 20 ms": 0.02, "vel, DR, 100 ms": 0.1, "vel, 40 ms": None, "pose, DR, 20 ms": None}
"""Latency [s] of each drawn scheme; None if its |G| is not known in closed form."""


def draw(folder: Path) -> list[Path]:
    """Draw all figures into `folder`; return their paths."""
    import matplotlib

    matplotlib.use("Agg")
    folder.mkdir(parents=True, exist_ok=True)
    return [_errors(folder / "control_errors.png"), _amplification(folder / "control_amplification.png")]


def _errors(path: Path) -> Path:
    """Draw three followers in left echelon on the figure-eight, starting 0.15 m and 0.2 rad off their slots."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(3, 3, figsize=(12, 7), sharex=True, sharey="row", constrained_layout=True)
    for column, condition in enumerate(("clean", "network", "noise")):
        setup = setup_of(condition, "left")
        chain, leader = (
            Chain(setup, astray(setup.slots, setup.seed)),
            Leader(PATHS["figure_eight"], setup.slots, setup.limits),
        )
        times: list[float] = []
        series: list[list[tuple[float, float, float]]] = [[] for _ in setup.slots]
        while chain.time_s < RUN_S:
            times.append(chain.time_s)
            chain.step(leader.step(CONTROL_PERIOD_S))
            for index, line in enumerate(series):
                error = chain.errors(index)
                line.append((1e3 * error.distance_m, DEGREES * error.bearing_rad, DEGREES * error.heading_rad))
        for row, label in enumerate(("distance error [mm]", "bearing error [deg]", "heading error [deg]")):
            for index, line in enumerate(series):
                axes[row][column].plot(times, [values[row] for values in line], lw=0.8, label=f"F{index + 1}")
            axes[row][0].set_ylabel(label)
            axes[row][column].grid(alpha=0.3)
        axes[0][column].set_title(condition)
        axes[2][column].set_xlabel("time [s]")
    for row, limit in enumerate((40.0, 5.0, 10.0)):
        axes[row][0].set_ylim(-limit, limit)
    axes[0][0].legend()
    figure.savefig(path, dpi=120)
    plt.close(figure)
    return path


def _amplification(path: Path) -> Path:
    """Draw the amplification of one hop: measured over three hops, and the theory for dead reckoning.

    The theory is sup |G| = |(1 + K tau) j w + K| / |j w + K|.
    """
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 5), constrained_layout=True)
    for scheme in SCHEMES:
        if scheme.name not in DRAWN:
            continue
        measured = []
        for omega in FREQUENCIES_RADPS:
            deviations = speed_wave(scheme, omega, HOPS)
            measured.append((deviations[HOPS] / deviations[0]) ** (1.0 / HOPS))
        (line,) = axes.plot([w / (2.0 * pi) for w in FREQUENCIES_RADPS], measured, "o", label=scheme.name)
        latency_s, k = DRAWN[scheme.name], scheme.gains.k_per_s
        if latency_s is not None:
            fine = [0.05 * n for n in range(6, 170)]
            theory = [hypot((1.0 + k * latency_s) * w, k) / hypot(w, k) for w in fine]
            axes.plot([w / (2.0 * pi) for w in fine], theory, "-", color=line.get_color(), lw=1.0)
    axes.axhline(1.0, color="black", lw=0.8)
    axes.set(xlabel="frequency [Hz]", ylabel="amplification of one hop", title="Speed waves along the chain")
    axes.legend()
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)
    plt.close(figure)
    return path
