"""Real robots on separate machines: each has its own router, agent and `lfa-driver`; words are said on any of them."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from msgspec.structs import replace

from lfa.deploy.bench.harness.team import Team, endless
from lfa.deploy.process.process_group import ProcessSpec
from lfa.protocol.messages.codec import decode
from lfa.protocol.messages.robot import Sensors
from lfa.protocol.messages.stop import StopWord
from lfa.protocol.topics import TOPIC, key
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from tests.rigs.live_team import WHOLE_S
from tests.rigs.network_namespaces import WORLD_HOST, Net, host_socket, missing, table_on_hosts

WHY_NOT = missing()
pytestmark = [pytest.mark.hosts, pytest.mark.skipif(WHY_NOT is not None, reason=str(WHY_NOT))]

ROBOTS, FLEET, APART_M = (1, 2, 3), "real", 3.0
DRIVES_MPS, RESTS_MPS = 0.03, 0.005
STANDS_S = 1.5
LFA = (sys.executable, "-c", "from lfa.deploy.cli import main; main()")


class RealRobots:
    """Three robots with drivers of their own, each on its machine, and what their drivers say of their wheels."""

    def __init__(self, net: Net, team: Team, folder: Path) -> None:
        self.team = team
        self._net, self._folder = net, folder
        self._inbox = Inbox(every=True)
        self.bus = ZenohBus(f"unixsock-stream/{team.folder / 'router.sock'}", self._inbox)
        self.bus.follow(frozenset({key(FLEET, "*", "sensors")}))
        self.sensors: dict[str, Sensors] = {}
        self.fastest_mps: dict[str, float] = {}
        """Greatest speed of each driver's wheels since `stand_for` began."""

    def says(self, host: int, *words: str) -> tuple[int, str]:
        """Say a command on a machine, at its own router; return its exit code and its words."""
        there = ("--fleet", FLEET, "--connect", host_socket(host, self.team.folder))
        command = [*self._net.enter(host), *LFA, *words, *there]
        done = subprocess.run(command, capture_output=True, text=True, timeout=90.0, check=False)
        return done.returncode, (done.stdout + done.stderr).strip()

    def until(self, what: str, complaint: str, *robots: int) -> None:
        """Wait until `drives` or `rests` holds of these robots, of all if none is named."""
        names = [f"driver{robot}" for robot in robots or ROBOTS]
        self.team.wait_until(lambda: all(getattr(self, what)(name) for name in names), complaint, WHOLE_S)

    def drives(self, driver: str) -> bool:
        self._hear()
        return driver in self.sensors and abs(self.sensors[driver].twist.linear_x) > DRIVES_MPS

    def rests(self, driver: str) -> bool:
        self._hear()
        return driver in self.sensors and abs(self.sensors[driver].twist.linear_x) < RESTS_MPS

    def is_told(self, driver: str) -> bool:
        """The driver's gateway knows that the fleet is stopped, and is certain."""
        self._hear()
        return driver in self.sensors and self.sensors[driver].stop.certain and self.sensors[driver].stop.word.stand

    def stand_for(self, seconds: float) -> dict[str, float]:
        """Return the drivers whose wheels turn within the next seconds of their own clocks, with their speeds."""
        self._hear()
        self.fastest_mps.clear()
        since = {name: one.header.stamp for name, one in self.sensors.items()}
        self.team.wait_until(
            lambda: self._hear() or all(self.sensors[name].header.stamp > at + seconds for name, at in since.items()),
            "the drivers do not go on",
            WHOLE_S,
        )
        return {name: speed for name, speed in self.fastest_mps.items() if speed > RESTS_MPS}

    def kill(self, robot: int) -> int:
        """Kill a driver (SIGKILL) and start it anew; return the incarnation that died."""
        died = self.sensors.pop(f"driver{robot}").header.incarnation
        self.team.signal(f"driver{robot}", signal.SIGKILL)
        return died

    def motors_stopped(self, robot: int) -> Path:
        """Return the file that the stop command of a robot's watchdog makes."""
        return self._folder / f"stopped{robot}"

    def _hear(self) -> bool:
        for arrival in self._inbox.take():
            if isinstance(arrival.payload, bytes):
                message = decode(arrival.payload, TOPIC["sensors"].type)
                assert isinstance(message, Sensors)
                name, speed = message.header.sender, abs(message.twist.linear_x)
                self.sensors[name] = message
                self.fastest_mps[name] = max(self.fastest_mps.get(name, 0.0), speed)
        return False


@pytest.fixture
def real(tmp_path: Path) -> Iterator[RealRobots]:
    starts = tuple((-APART_M * place, 0.0, 0.0) for place in range(len(ROBOTS)))
    course = endless(len(ROBOTS))
    formation = replace(course.mission.formation, separation_m=APART_M, side="column")
    course = replace(
        course,
        world=replace(course.world, starts=starts, real_robots=ROBOTS),
        mission=replace(course.mission, formation=formation),
    )

    def table(usual: Sequence[ProcessSpec], sockets: Path) -> list[ProcessSpec]:
        rows = table_on_hosts(usual, sockets, len(ROBOTS))
        for robot, (x, y, theta) in zip(ROBOTS, starts, strict=True):
            words = ("--id", str(robot), f"--at={x},{y},{theta}", "--fleet", FLEET)
            stop = ("--stop-command", f"touch {tmp_path / f'stopped{robot}'}")
            there = ("--connect", host_socket(robot, sockets))
            arguments = ("lfa.deploy.robot.cli", *words, *there, *stop)
            rows.append(ProcessSpec(f"driver{robot}", arguments, command_prefix=net.enter(robot)))
        return rows

    with Net(len(ROBOTS) + 1) as net, Team(course, table, fleet=FLEET) as team:
        robots = RealRobots(net, team, tmp_path)
        try:
            robots.until("drives", "the robots do not drive")
            yield robots
        finally:
            robots.bus.close()


def test_drivers_on_their_machines_stop_pause_go_on_and_stay_stopped_when_they_are_killed(real: RealRobots) -> None:
    everybody = ", ".join(f"robot{robot}" for robot in ROBOTS)
    assert real.says(2, "stop") == (0, f"stopped: {everybody} (epoch 1)")
    real.until("rests", "they drive after a stop")

    real.kill(1)
    real.team.restart("driver1")
    real.until("is_told", "a driver that starts anew is not told of the stop", 1)
    assert real.motors_stopped(1).exists(), "nothing stopped the motors of a driver that was killed"
    assert real.stand_for(STANDS_S) == {}, "it drives after it acknowledged a stop"
    assert real.says(3, "resume") == (0, f"may go: {everybody} (epoch 2)")
    real.until("drives", "they do not drive after a resume")

    assert real.says(1, "pause")[0] == 0
    real.until("rests", "they drive in a pause")
    assert {one.stop.word for one in real.sensors.values()} == {StopWord(2)}, "a pause is no stop"
    assert real.says(WORLD_HOST, "go")[0] == 0
    real.until("drives", "they do not drive after a pause")

    real.kill(2)
    code, said = real.says(3, "stop")
    assert (code, said.partition(":")[2]) == (1, " robot1, robot3 (epoch 3)\nNOT STOPPED, no answer: robot2")
    real.team.restart("driver2")
    real.until("is_told", "a driver that missed the stop is not told of it", 2)
    assert real.says(WORLD_HOST, "stop") == (0, f"stopped: {everybody} (epoch 3)")
    assert real.stand_for(STANDS_S) == {}, "it drives, and was told of a stop"
    assert real.says(2, "resume") == (0, f"may go: {everybody} (epoch 4)")
    real.until("drives", "they do not drive after a resume")
