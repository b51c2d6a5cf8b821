"""A chain with a real robot in it: the agents are the same, and its own driver brakes it when its agent dies."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lfa.protocol.geometry import STILL
from lfa.protocol.messages.codec import decode
from lfa.protocol.messages.robot import Localization, Sensors
from lfa.protocol.messages.simulation import Truth
from lfa.protocol.messages.team import Tracking
from lfa.protocol.topics import TOPIC, address, key
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from tests.processes.test_by_hand import FLEET, Terminals, terminals
from tests.rigs.lfa_runs import eventually

__all__ = ["terminals"]

pytestmark = pytest.mark.processes

REAL = 2
GOAL_M = 3.0
SCENARIO = (
    "straight",
    *("--robots", "3", "--set", f"mission.leading.route_m=[[{GOAL_M}, 0.0]]"),
    *("--set", "world.starts=[[0.0, 0.0, 0.0], [-1.2, 0.0, 0.0], [-2.4, 0.0, 0.0]]"),
    *("--set", "mission.formation.side=column", "--set", "mission.cold_start=full_house"),
    *("--set", f"world.real_robots=[{REAL}]"),
)


class Mixed:
    """Router, world, three agents and a driver; what was heard last."""

    def __init__(self, terminals: Terminals) -> None:
        terminals.router()
        self._inbox = Inbox()
        self._bus = ZenohBus(terminals.endpoint, self._inbox)
        wanted = {key(FLEET, "*", topic) for topic in ("sensors", "localization", "tracking", "truth")}
        self._bus.follow(frozenset(wanted))
        terminals.start("lfa.world.cli", *SCENARIO, *terminals.team())
        terminals.start("lfa.deploy.robot.cli", "--id", str(REAL), "--at=-1.2,0,0", *terminals.team())
        self.agents = {n: terminals.agent(n, "leader" if n == 1 else "follower") for n in (1, 2, 3)}
        self.sensors: Sensors | None = None
        self.fix: Localization | None = None
        self.truth: Truth | None = None
        self.tracking: dict[str, Tracking] = {}
        self.hardware: set[tuple[str, str]] = set()

    def listen(self) -> None:
        for arrival in self._inbox.take():
            where = address(arrival.key)
            assert where is not None and isinstance(arrival.payload, bytes)
            message = decode(arrival.payload, TOPIC[where.topic].type)
            match message:
                case Sensors():
                    self.hardware.add((where.owner, message.header.sender))
                    if where.owner == f"robot{REAL}":
                        self.sensors = message
                case Localization() if where.owner == f"robot{REAL}":
                    self.fix = message
                case Tracking():
                    self.tracking[message.header.sender] = message
                case Truth():
                    self.truth = message

    def until(self, holds: str, complaint: str, within_s: float = 60.0) -> None:
        def heard() -> bool:
            self.listen()
            return bool(getattr(self, holds)())

        eventually(heard, complaint, within_s)

    def moves(self) -> bool:
        return self.sensors is not None and self.sensors.twist.linear_x > 0.1

    def rests(self) -> bool:
        return self.sensors is not None and self.sensors.twist == STILL

    def arrived(self) -> bool:
        """The leader is at the goal, and the real robot a place behind it, as robot 3 is behind the real one."""
        if self.truth is None or self.fix is None or self.sensors is None:
            return False
        xs = {robot.id: robot.x for robot in self.truth.robots}
        return abs(xs[1] - GOAL_M) < 0.15 and abs(self.fix.pose_map.x - GOAL_M + 1.2) < 0.3 and self.rests()

    def close(self) -> None:
        self._bus.close()


def test_a_real_robot_follows_in_the_chain_to_the_goal_and_is_seen_by_the_others(terminals: Terminals) -> None:
    mixed = Mixed(terminals)
    try:
        mixed.until("arrived", "the chain does not arrive")
        assert mixed.hardware == {("robot1", "world"), ("robot2", "driver2"), ("robot3", "world")}
        assert mixed.tracking["robot3"].predecessor == REAL
        assert mixed.tracking["robot2"].error_m < 0.1 and mixed.tracking["robot3"].error_m < 0.1
        assert mixed.truth is not None and mixed.fix is not None
        shown = next(robot.x for robot in mixed.truth.robots if robot.id == REAL)
        assert abs(shown - mixed.fix.pose_map.x) < 0.05, "the world shows it where it says it is"
    finally:
        mixed.close()


def test_a_real_robot_whose_agent_is_killed_brakes_by_itself(terminals: Terminals) -> None:
    mixed = Mixed(terminals)
    try:
        mixed.until("moves", "the real robot does not move")
        agent: subprocess.Popen[str] = mixed.agents[REAL]
        agent.kill()
        agent.wait()
        mixed.until("rests", "it drives on without an agent", 10.0)
        assert mixed.sensors is not None and mixed.sensors.odometer_m < GOAL_M
    finally:
        mixed.close()


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGQUIT])
def test_a_driver_whose_terminal_is_closed_ends_in_order(number: signal.Signals, tmp_path: Path) -> None:
    """What ends it otherwise leaves the wheels at the last command."""
    command = [sys.executable, "-P", "-m", "lfa.deploy.robot.cli", "--id", "3"]
    command += ["--connect", f"unixsock-stream/{tmp_path}/none"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as driver:
        assert driver.stdout is not None and driver.stderr is not None
        driver.stderr.readline()
        driver.send_signal(number)
        assert driver.stdout.read() == f"driver3: ended, by {number.name}, before a router was there\n"
    assert driver.returncode == 0
