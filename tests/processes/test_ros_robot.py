"""A ROS robot, played by a program that nobody here wrote, as a member of a chain with no code written for it."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Iterator
from math import fsum, inf, sqrt
from pathlib import Path

import pytest

from lfa.deploy.bench.harness.ros_member import DEADMAN_MS, LEADS_MS, WATCHDOG_MS
from lfa.protocol import clock
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.team import PoseStamped, Tracking
from lfa.protocol.transport.zenoh_ros import ros_session
from tests.processes.test_by_hand import Terminals, terminals
from tests.rigs.foreign_peers import start
from tests.rigs.lfa_runs import eventually
from tests.rigs.ros_peers import free_endpoint

__all__ = ["terminals"]

pytestmark = pytest.mark.processes

ROS = 2
RMS_MM, REPORTS = 20.0, 100
"""Bar [mm] of its distance from its slot over the last reports, 4 s of them."""
SCENARIO = (
    "straight",
    *("--robots", "4", "--set", "mission.leading.route_m=[[30.0, 0.0]]", "--set", "mission.formation.side=column"),
    *("--set", "world.starts=[[0.0, 0.0, 0.0], [-1.2, 0.0, 0.0], [-2.4, 0.0, 0.0], [-3.6, 0.0, 0.0]]"),
    *("--set", "mission.cold_start=full_house", "--set", f"world.real_robots=[{ROS}]"),
)


class Chain:
    """Router of ROS, router of the fleet, world, agents, driver and the ROS robot."""

    def __init__(self, terminals: Terminals, place: Path) -> None:
        self.terminals = terminals
        self._endpoint = free_endpoint()
        self._router = ros_session(self._endpoint, serve=True)
        self._log = place / "commands"
        self.robot = start("sdk", "sdk_robot.py", self._endpoint.rpartition(":")[2], "/bot", str(self._log), home=place)
        assert self.robot.stdout is not None
        assert self.robot.stdout.readline() == "ready\n", self.robot.communicate()
        terminals.router()
        terminals.look_on()
        terminals.start("lfa.world.cli", *SCENARIO, *terminals.team())
        words = ("--id", str(ROS), "--at=-1.2,0,0", "--ros", self._endpoint)
        self.driver = terminals.start("lfa.deploy.robot.cli", *words, *terminals.team())
        assert self.driver.stdout is not None
        assert "TwistStamped on /bot/cmd_vel" in self.driver.stdout.readline(), self.driver.communicate()
        self.agents = {n: terminals.agent(n, "leader" if n == 1 else "follower") for n in (1, 2, 3, 4)}
        self.roles: dict[str, Role] = {}
        self.errors_m: list[float] = []
        self.led_at = inf
        """Time [s] at which the ROS robot first led."""

    def commands(self) -> list[tuple[float, float, float]]:
        """Return time [s], v and omega of each command that the robot heard."""
        lines = self._log.read_text().splitlines()
        return [tuple(map(float, line.split())) for line in lines if line.count(" ") == 2]  # type: ignore[misc]

    def listen(self) -> None:
        for message in self.terminals.heard():
            if isinstance(message, PoseStamped):
                self.roles[message.header.sender] = message.role
                if message.header.sender == f"robot{ROS}" and message.role is Role.LEADER:
                    self.led_at = min(self.led_at, message.header.stamp)
            if isinstance(message, Tracking) and message.header.sender == f"robot{ROS}":
                self.errors_m.append(message.error_m)

    def drives(self) -> bool:
        self.listen()
        return any(v > 0.2 for _, v, _ in self.commands()[-5:])

    def rests(self) -> bool:
        last = self.commands()[-3:]
        return all((v, omega) == (0.0, 0.0) for _, v, omega in last)

    def leads(self) -> bool:
        self.listen()
        return self.roles.get(f"robot{ROS}") is Role.LEADER

    def rms_mm(self) -> float:
        """Return the root mean square [mm] of its last distances from its slot; infinite before there are enough."""
        last = self.errors_m[-REPORTS:]
        return 1e3 * sqrt(fsum(error_m**2 for error_m in last) / REPORTS) if len(last) == REPORTS else inf

    def zero_ms(self, at: float) -> float:
        """Return the time [ms] from `at` [s, UNIX time] to the first of the zeros that the robot keeps to."""
        commands = self.commands()
        moving = [when for when, v, omega in commands if (v, omega) != (0.0, 0.0)]
        return 1e3 * min(when - at for when, _, _ in commands if when > max([at, *moving]))

    def close(self) -> None:
        self.robot.kill()
        self.robot.communicate()
        self._router.close()


@pytest.fixture
def chain(terminals: Terminals, tmp_path: Path) -> Iterator[Chain]:
    made = Chain(terminals, tmp_path)
    yield made
    made.close()


def killed(process: subprocess.Popen[str]) -> float:
    """Kill a process; return when [s, UNIX time]."""
    at = time.time()
    process.send_signal(signal.SIGKILL)
    process.wait()
    return at


def test_a_ros_robot_follows_leads_after_the_leaders_death_and_stops_when_its_agent_dies(chain: Chain) -> None:
    """With the bars of `lfa bench ros --rows 'member/*'`."""
    eventually(chain.drives, "the ROS robot is not driven", 60.0)
    eventually(lambda: chain.drives() and chain.rms_mm() < RMS_MM, "it does not follow as closely as told", 60.0)
    at = clock.now()
    killed(chain.agents[1])
    eventually(chain.leads, "it does not lead after the leader's death", 30.0)
    assert 1e3 * (chain.led_at - at) < LEADS_MS
    eventually(chain.drives, "it does not drive on as leader", 30.0)
    at = killed(chain.agents[ROS])
    eventually(chain.rests, "its wheels are not told zero when its agent is dead", 10.0)
    assert chain.zero_ms(at) < DEADMAN_MS


def test_a_killed_driver_leaves_a_watchdog_that_tells_the_wheels_zero(chain: Chain) -> None:
    eventually(chain.drives, "the ROS robot is not driven", 60.0)
    at = killed(chain.driver)
    eventually(chain.rests, "nobody told the wheels zero", 10.0)
    assert chain.zero_ms(at) < WATCHDOG_MS


def test_a_driver_that_is_asked_to_end_tells_the_wheels_zero(chain: Chain) -> None:
    eventually(chain.drives, "the ROS robot is not driven", 60.0)
    chain.driver.terminate()
    eventually(chain.rests, "nobody told the wheels zero", 10.0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--ros", "tcp/10.0.0.9:7447"), "run lfa-driver on the robot"),
        (("--ros", "tcp/127.0.0.1:1"), "no ROS router answers"),
        (("--ros", "--robot", "spot"), "must be one of turtlebot3"),
        (("--ros", "--laser", "1,2"), "--laser 1,2: must be x,y,theta"),
    ],
)
def test_bad_input_is_one_line(words: tuple[str, ...], said: str, terminals: Terminals) -> None:
    driver = terminals.start("lfa.deploy.robot.cli", "--id", "2", *words, *terminals.team())
    _, err = driver.communicate(timeout=60.0)
    assert driver.returncode == 2
    (line,) = err.splitlines()
    assert said in line
