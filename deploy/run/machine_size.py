"""How many robots this machine carries as processes in real time, and the rates at which it carries more.

The costs were fitted to runs of twelve robots on two cores; `lfa bench agents` prints an agent's own part of them. A
run of more robots than fit loses its lease now and then, and its followers their leader.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from msgspec.structs import replace

from lfa.protocol.mission import Mission, Profile
from lfa.protocol.output import write_line
from lfa.world.description.load import Scenario

TEAM_CORES = 0.1
"""Share of a core that a run takes apart from its robots: launcher, and what world, router and recorder take anyway."""
ROBOT_CORES, STEP_CORES = 0.018, 0.0019
"""Share of a core for each robot, and for each of its control steps a second; with its part of world, router and
recorder."""
WORLD_PART = 1.0 / 7.0
"""Part of a robot's costs that falls on the world, which is one process: it has one core, however many there are.
Router and recorder take as much."""
USUAL_SHARE, PATIENT_SHARE = 0.75, 0.95
"""Share of the machine that a run may take: the rest is what keeps processes in time. The profiles `wifi` and `auto`
bear three times the lateness of the others, or more."""
PATIENT = frozenset({"wifi", "auto"})
SLOW_HZ, FEW_BEAMS = 20.0, 90
SLOW_PROFILE: Profile = "auto"
"""Profile of a team that nearly fills its machine: it bears twice what `wifi` does while all start at once, and follows
a lost leader sooner once its processes keep time, where `wifi` waits for 1 s whatever happens."""
_QUOTA = Path("/sys/fs/cgroup/cpu.max")


def cores() -> float:
    """Return the number of cores that this process may use: its affinity, or a container's quota if that is less."""
    allowed = float(len(os.sched_getaffinity(0)))
    try:
        quota, period = _QUOTA.read_text().split()
        return min(allowed, float(quota) / float(period))
    except (OSError, ValueError):  # no such file, or no quota: `max`
        return allowed


def carried(mission: Mission, on_cores: float) -> int:
    """Return how many robots with the rates of `mission` a machine with so many cores carries; at least 1."""
    share = PATIENT_SHARE if mission.profile in PATIENT else USUAL_SHARE
    each = ROBOT_CORES + STEP_CORES * mission.control_hz
    return max(1, int(min((share * on_cores - TEAM_CORES) / each, share / (WORLD_PART * each))))


def fitted(scenario: Scenario, kept: frozenset[str]) -> Scenario:
    """Return `scenario` with lower rates if this machine carries too few robots for it, and say so in a line.

    `kept` are keys that the command line sets: they stay as they are.
    """
    fit, text = fit_to(scenario, kept, cores())
    if text:
        write_line(text, sys.stderr)
    return fit


def fit_to(scenario: Scenario, kept: frozenset[str], on_cores: float) -> tuple[Scenario, str]:
    """Return `scenario` as it fits a machine of so many cores, and the line that says so; empty if nothing differs."""
    robots, most = len(scenario.mission.robots), carried(scenario.mission, on_cores)
    if robots <= most:
        return scenario, ""
    lower = slower(scenario, kept)
    then = carried(lower.mission, on_cores)
    hz, slow_hz = scenario.mission.control_hz, lower.mission.control_hz
    machine = f"this machine ({on_cores:g} core{'' if on_cores == 1.0 else 's'}) carries {most} robots at {hz:g} Hz"
    if lower != scenario:
        machine += f", {then} with {_rates(lower)}"
    if robots > then:
        return lower, f"{machine}: {robots} robots will be late, and may lose their leader"
    keeps = f" (--set mission.control_hz={hz:g} keeps that rate)" if slow_hz < hz else ""
    return lower, f"{machine}: {robots} robots run so{keeps}"


def slower(scenario: Scenario, kept: frozenset[str] = frozenset()) -> Scenario:
    """Return `scenario` at the rates at which a machine carries more robots; keys in `kept` stay as they are."""
    mission, lidar = scenario.mission, scenario.world.lidar
    if "mission.control_hz" not in kept:
        mission = replace(mission, control_hz=min(mission.control_hz, SLOW_HZ))
    if "mission.profile" not in kept:
        mission = replace(mission, profile=SLOW_PROFILE)
    if "world.lidar.beams" not in kept:
        lidar = replace(lidar, beams=min(lidar.beams, FEW_BEAMS))
    return replace(scenario, mission=mission, world=replace(scenario.world, lidar=lidar))


def _rates(scenario: Scenario) -> str:
    mission = scenario.mission
    beams = scenario.world.lidar.beams or "no"
    return f"control at {mission.control_hz:g} Hz, profile {mission.profile} and {beams} lidar beams"
