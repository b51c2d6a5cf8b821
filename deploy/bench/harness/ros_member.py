"""A ROS robot as the second of a chain of four in `straight`: how well it follows, and how soon it is told to stand.

The robot is a process of its own (`ros_robot.py`) that speaks ROS only; `lfa-driver --ros` makes it a member.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from math import fsum, sqrt
from pathlib import Path

from msgspec import structs

from lfa.deploy.bench.harness.child_process import pause, started
from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row
from lfa.deploy.bench.harness.team import Broken, Team
from lfa.protocol import clock
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.consensus import Role
from lfa.protocol.names import robot_name
from lfa.protocol.transport.zenoh_ros import ros_session
from lfa.world.description.load import Scenario, load

MEMBER, ROBOTS, SPACING_M = 2, 4, 1.2
SETTLE_S, WATCHED_S, DRIVES_S_MAX, PATIENCE_S = 12.0, 15.0, 30.0, 5.0
DRIVEN_MPS = 0.1
TIMING = timing_of("std")
DEADMAN_MS = 1e3 * (TIMING.deadman_s + 0.05)
"""Bar [ms] of a dead agent: the deadman, a period of the driver and one of the robot, and the way between them."""
LEADS_MS = 1e3 * TIMING.grant_s + 60.0
"""Bar [ms] of a dead leader: that of the worst kill in `lfa bench failover`."""
WATCHDOG_MS = 250.0


def member_rows(endpoint: str) -> Iterator[list[BenchRow]]:
    """Yield the rows; `endpoint`: a free TCP endpoint for the ROS router."""
    router = ros_session(endpoint, serve=True)
    try:
        with Team(_scenario()) as team:
            log = team.folder / "commands"
            robot = [sys.executable, "-m", "lfa.deploy.bench.harness.ros_robot", endpoint, "/bot", str(log)]
            with started(robot), started(_driver(team, endpoint)) as driver:
                yield from _measured(team, driver, _Wheels(log))
    finally:
        router.close()


def _measured(team: Team, driver: subprocess.Popen[bytes], wheels: _Wheels) -> Iterator[list[BenchRow]]:
    team.await_chain(ROBOTS, DRIVES_S_MAX)
    team.wait_until(wheels.driven, "the ROS robot is not driven", DRIVES_S_MAX)
    pause(team, SETTLE_S)
    since = clock.now()
    pause(team, WATCHED_S)
    errors_m = [
        report.error_m
        for report in team.heard.tracking
        if report.header.sender == robot_name(MEMBER) and report.header.stamp > since
    ]
    rms_mm = 1e3 * sqrt(fsum(error_m**2 for error_m in errors_m) / len(errors_m)) if errors_m else float("nan")
    yield [row("member", Quantity("distance from its slot, rms", "mm", 20.0), rms_mm)]
    yield [row("member", Quantity("leads after the leader's death", "ms", LEADS_MS), _leads_ms(team))]
    team.wait_until(wheels.driven, "the ROS robot does not drive as leader", DRIVES_S_MAX)
    at = team.signal(MEMBER, signal.SIGKILL)
    yield [
        row("member", Quantity("wheels at zero after its agent's death", "ms", DEADMAN_MS), wheels.zero_ms(team, at))
    ]
    team.restart(MEMBER)
    team.wait_until(wheels.driven, "the ROS robot is not driven again", DRIVES_S_MAX)
    at = clock.now()
    driver.kill()
    yield [
        row("member", Quantity("wheels at zero after its driver's death", "ms", WATCHDOG_MS), wheels.zero_ms(team, at))
    ]


class _Wheels:
    """Commands that reached the ROS robot, read from its log."""

    def __init__(self, log: Path) -> None:
        self._log = log

    def driven(self) -> bool:
        """Return True if the last command drives."""
        return any(v > DRIVEN_MPS for _, v, _ in self._commands()[-1:])

    def zero_ms(self, team: Team, at: float) -> float:
        """Return the time [ms] from `at` [s] to the first of the zeros that the robot keeps to; nan for none."""

        def rests() -> bool:
            last = self._commands()[-1:]
            return bool(last) and last[0][0] > at and last[0][1:] == (0.0, 0.0)

        if not _holds(team, rests):
            return float("nan")
        moving = [arrived for arrived, v, omega in self._commands() if (v, omega) != (0.0, 0.0)]
        return 1e3 * min(arrived - at for arrived, _, _ in self._commands() if arrived > max([at, *moving]))

    def _commands(self) -> list[tuple[float, float, float]]:
        """Return time [s], v [m/s] and omega [rad/s] of each command; the last line may be half written."""
        lines = self._log.read_text().splitlines(keepends=True) if self._log.exists() else []
        words = [line.split() for line in lines if line.endswith("\n")]
        return [(float(at), float(v), float(omega)) for at, v, omega in words]


def _leads_ms(team: Team) -> float:
    """Kill the leader; return the time [ms] until the ROS robot leads by its own poses; nan if it does not."""
    at = team.signal(1, signal.SIGKILL)

    def leads() -> bool:
        pose = team.heard.state.poses.get(MEMBER)
        return pose is not None and pose.message.role is Role.LEADER

    if not _holds(team, leads):
        return float("nan")
    return 1e3 * (team.heard.state.poses[MEMBER].message.header.stamp - at)


def _holds(team: Team, holds: Callable[[], bool]) -> bool:
    with suppress(Broken):
        team.wait_until(holds, "not seen", PATIENCE_S)
        return True
    return False


def _scenario() -> Scenario:
    scenario = load("straight")
    starts = tuple((-SPACING_M * place, 0.0, 0.0) for place in range(ROBOTS))
    world = structs.replace(scenario.world, starts=starts, real_robots=(MEMBER,))
    formation = structs.replace(scenario.mission.formation, side="column", separation_m=SPACING_M)
    mission = structs.replace(scenario.mission, formation=formation, cold_start="full_house")
    return structs.replace(scenario, world=world, mission=mission)


def _driver(team: Team, endpoint: str) -> list[str]:
    words = [sys.executable, "-m", "lfa.deploy.robot.cli", "--id", str(MEMBER), f"--at={-SPACING_M},0,0"]
    return [*words, "--ros", endpoint, "--fleet", team.fleet.name, "--connect", team.fleet.endpoint]
