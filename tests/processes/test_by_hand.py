"""Six terminals: router, world and agents started one by one, in any order, and one of them twice."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path

import msgspec
import pytest
from msgspec import structs

from lfa.agents.agent import Agent
from lfa.deploy.bench.agents.footprint import footprint
from lfa.protocol import clock
from lfa.protocol.messages.codec import Message, decode
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.team import Status, Tracking
from lfa.protocol.names import robot_name
from lfa.protocol.runtime.namesakes import refuse_twin
from lfa.protocol.topics import TOPIC, address, key
from lfa.protocol.transport.bus import Inbox
from lfa.protocol.transport.zenoh_bus import ZenohBus
from lfa.protocol.transport.zenoh_config import answers
from lfa.world.description.load import load
from tests.rigs.lfa_runs import eventually

pytestmark = pytest.mark.processes

FLEET = "hand"
BEHIND = """from lfa.protocol import clock
right = clock.wall_ms
clock.wall_ms = lambda: right() - 3_600_000
from lfa.agents.cli import main
main()
"""
"""`lfa-agent` on a machine whose wall clock is an hour behind."""
UNIQUE_MIB_MAX = 15.0
RSS_MB_MAX = 36.0


class Terminals:
    """Processes of one fleet and an onlooker on its bus."""

    def __init__(self, folder: Path) -> None:
        self.endpoint = f"unixsock-stream/{folder / 'router.sock'}"
        self._folder = folder
        self._children: list[subprocess.Popen[str]] = []
        self._bus: ZenohBus | None = None
        self._inbox = Inbox()

    def router(self) -> subprocess.Popen[str]:
        child = self.start("lfa.deploy.fleet.host.router", "--listen", self.endpoint)
        eventually(lambda: answers(self.endpoint), "the router does not answer")
        return child

    def world(self, robots: int = 2) -> subprocess.Popen[str]:
        return self.start("lfa.world.cli", "straight", "--robots", str(robots), *self.team())

    def lfa(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", "from lfa.deploy.cli import main; main()", *arguments, *self.team()]
        return subprocess.run(command, capture_output=True, text=True, timeout=60)

    def agent(
        self, robot_id: int, role: str = "follower", environment: Mapping[str, str] | None = None
    ) -> subprocess.Popen[str]:
        arguments = ("lfa.agents.cli", "--role", role, "--id", str(robot_id), *self.team())
        return self.start(*arguments, environment=environment)

    def agent_behind(self, robot_id: int) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", BEHIND, "--role", "follower", "--id", str(robot_id), *self.team()]
        return self._run(command, os.environ)

    def token(self, robot_id: int, number: int) -> None:
        """Hold a liveliness token of this robot for an incarnation that does not exist."""
        assert self._bus is not None
        self._bus.announce(FLEET, robot_name(robot_id), number)

    def look_on(self) -> None:
        self._bus = ZenohBus(self.endpoint, self._inbox)
        self._bus.follow(frozenset(key(FLEET, "*", topic) for topic in ("tracking", "status", "pose")))

    def heard(self) -> list[Message]:
        """All that came since the last call; of each key only the newest."""
        arrivals = [a for a in self._inbox.take() if isinstance(a.payload, bytes)]
        topics = [address(arrival.key) for arrival in arrivals]
        return [decode(a.payload, TOPIC[t.topic].type) for a, t in zip(arrivals, topics, strict=True) if t]  # type: ignore[arg-type]

    def end(self) -> None:
        if self._bus is not None:
            self._bus.close()
        for child in reversed(self._children):
            child.kill()
            child.communicate()

    def team(self) -> tuple[str, ...]:
        return ("--fleet", FLEET, "--connect", self.endpoint)

    def start(self, *arguments: str, environment: Mapping[str, str] | None = None) -> subprocess.Popen[str]:
        return self._run([sys.executable, "-m", *arguments], {**os.environ, **(environment or {})})

    def _run(self, command: list[str], environment: Mapping[str, str]) -> subprocess.Popen[str]:
        child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
        self._children.append(child)
        return child


@pytest.fixture
def terminals() -> Iterator[Terminals]:
    folder = Path(tempfile.mkdtemp(prefix="lfa-"))  # short: a socket's path has 107 bytes at most
    opened = Terminals(folder)
    yield opened
    opened.end()
    shutil.rmtree(folder)


def follows(terminals: Terminals, robot: str, incarnation_not: int | None = None) -> bool:
    """`robot` has just said whom it follows, in another life than `incarnation_not`."""
    said = (message for message in terminals.heard() if isinstance(message, Tracking))
    return any(m.header.sender == robot and m.header.incarnation != incarnation_not for m in said)


def test_agents_started_before_router_and_world_wait_and_then_follow(terminals: Terminals) -> None:
    follower = terminals.agent(2)
    assert follower.stderr is not None
    assert follower.stderr.readline().startswith("no router at ")
    terminals.agent(1, "leader")
    terminals.router()
    terminals.look_on()
    terminals.world()
    eventually(lambda: follows(terminals, "robot2"), "robot 2 follows nobody")


def test_a_killed_follower_that_starts_again_follows_again(terminals: Terminals) -> None:
    terminals.router()
    terminals.look_on()
    terminals.world()
    terminals.agent(1, "leader")
    follower = terminals.agent(2)
    first_life: list[int] = []

    def first() -> bool:
        first_life.extend(m.header.incarnation for m in terminals.heard() if isinstance(m, Tracking))
        return bool(first_life)

    eventually(first, "robot 2 follows nobody")
    follower.kill()
    follower.wait()
    terminals.agent(2)
    eventually(lambda: follows(terminals, "robot2", first_life[0]), "robot 2 does not follow in its second life")


def test_a_robot_that_returns_with_a_clock_set_back_says_so_in_a_line_and_follows(terminals: Terminals) -> None:
    terminals.router()
    terminals.look_on()
    terminals.world()
    terminals.agent(1, "leader")
    follower = terminals.agent(2)
    eventually(lambda: follows(terminals, "robot2"), "robot 2 follows nobody")
    follower.kill()
    follower.wait()
    returned = terminals.agent_behind(2)
    terminals.heard()
    eventually(lambda: follows(terminals, "robot2"), "robot 2 does not follow with a clock that is an hour behind")
    returned.terminate()
    _, said = returned.communicate(timeout=20.0)
    assert said.count("robot2: the fleet knows a later incarnation") == 1


@pytest.mark.parametrize("number", [2**53 + 1, 2**53 - 1, 2**52])
def test_a_stray_token_of_any_number_locks_no_robot_out(terminals: Terminals, number: int) -> None:
    terminals.router()
    terminals.look_on()
    terminals.world()
    terminals.agent(1, "leader")
    follower = terminals.agent(2)
    eventually(lambda: follows(terminals, "robot2"), "robot 2 follows nobody")
    terminals.token(2, number)
    follower.kill()
    follower.wait()
    terminals.agent(2)
    terminals.heard()
    eventually(lambda: follows(terminals, "robot2"), f"robot 2 is locked out by a token with the number {number}")


def test_a_token_that_nobody_speaks_under_is_no_twins(terminals: Terminals) -> None:
    """Though it was not seen before the own token was declared, as happens on a busy machine."""
    terminals.router()
    terminals.look_on()
    terminals.token(2, 2**52)
    inbox = Inbox()
    bus = ZenohBus(terminals.endpoint, inbox)
    try:
        for number in (5, 2**52 + 5):
            refuse_twin(bus, inbox, FLEET, 0.1, Agent(2, number, FLEET, 0), [])
    finally:
        bus.close()


def test_of_two_that_start_at_the_same_time_under_one_name_one_runs(terminals: Terminals) -> None:
    terminals.router()
    twins = [terminals.agent(2), terminals.agent(2)]
    eventually(lambda: any(twin.poll() is not None for twin in twins), "both run")
    ended = next(twin for twin in twins if twin.poll() is not None)
    _, said = ended.communicate(timeout=5.0)
    assert (ended.returncode, "robot2 already runs" in said) == (2, True)
    clock.sleep(2.0)
    assert [twin.poll() for twin in twins].count(None) == 1, "neither runs"


def test_a_router_that_answers_late_hides_no_token(terminals: Terminals) -> None:
    """Or a robot that starts on a busy machine takes a stray token for a twin that has started with it, and ends."""
    router = terminals.router()
    terminals.look_on()
    terminals.token(2, 2**52)
    bus = ZenohBus(terminals.endpoint, Inbox())
    try:
        router.send_signal(signal.SIGSTOP)
        late = threading.Timer(0.5, router.send_signal, [signal.SIGCONT])
        late.start()
        assert bus.living(FLEET, robot_name(2), timeout_s=0.2) == [2**52]
        late.join()
    finally:
        router.send_signal(signal.SIGCONT)
        bus.close()


def test_a_process_that_slept_while_another_took_its_name_ends_in_one_line(terminals: Terminals) -> None:
    terminals.router()
    terminals.look_on()
    terminals.world()
    terminals.agent(1, "leader")
    asleep = terminals.agent(2)
    eventually(lambda: follows(terminals, "robot2"), "robot 2 follows nobody")
    asleep.send_signal(signal.SIGSTOP)
    terminals.agent(2)
    terminals.heard()
    eventually(lambda: follows(terminals, "robot2"), "robot 2 does not follow in its second incarnation")
    asleep.send_signal(signal.SIGCONT)
    _, said = asleep.communicate(timeout=30.0)
    assert asleep.returncode == 2
    assert said.endswith(f"robot2 already runs in fleet {FLEET!r}: end that one, or give another --id\n")


def test_an_id_that_already_runs_is_refused_in_one_line(terminals: Terminals) -> None:
    terminals.router()
    terminals.look_on()
    terminals.world()
    terminals.agent(2)
    eventually(lambda: any(m.header.sender == "robot2" for m in terminals.heard()), "robot 2 says nothing")
    second = terminals.agent(2)
    _, said = second.communicate(timeout=20.0)
    assert second.returncode == 2
    assert said.count("\n") == 1
    assert "robot2 already runs" in said


def test_a_second_router_at_the_same_place_is_refused_in_one_line(terminals: Terminals) -> None:
    terminals.router()
    command = [sys.executable, "-P", "-m", "lfa.deploy.fleet.host.router", "--listen", terminals.endpoint]
    second = subprocess.run(command, capture_output=True, text=True, timeout=20.0, check=False)
    assert second.returncode == 2
    assert second.stderr.count("\n") == 1
    assert answers(terminals.endpoint), "the first router has gone"


def test_an_agent_is_small(terminals: Terminals) -> None:
    """At most 15 MiB of its own while it leads, and 36 MB resident with the pages that it shares.

    20 MB of an agent are pages of Python's and Zenoh's libraries, which all processes of a machine share; how many of
    them count as resident differs from machine to machine by more than a module of ours takes.
    """
    terminals.router()
    terminals.look_on()
    terminals.world()
    leader = terminals.agent(1, "leader")
    terminals.agent(2)  # the first election of a fleet waits for everybody
    resident_mb: list[float] = []

    def told() -> bool:
        said = [m for m in terminals.heard() if isinstance(m, Status) and m.header.sender == "robot1"]
        resident_mb.extend(m.counters["rss_mib"] * 2**20 / 1e6 for m in said if m.role is Role.LEADER)
        return len(resident_mb) >= 2

    eventually(told, "robot 1 does not lead")
    assert footprint(leader.pid).unique_mib < UNIQUE_MIB_MAX
    assert max(resident_mb) < RSS_MB_MAX


def test_a_fleet_goes_on_without_robots_that_the_operator_declares_lost(terminals: Terminals) -> None:
    terminals.router()
    terminals.world(robots=4)
    terminals.agent(1)
    terminals.look_on()
    waits = "waiting for robot2, robot3, robot4"
    eventually(lambda: any(isinstance(m, Status) and m.text == waits for m in terminals.heard()), waits)
    alive = terminals.lfa("forget", "1")
    assert (alive.returncode, alive.stderr) == (2, "lfa: robot 1 lives: end its process first, or let it join\n")
    stranger = terminals.lfa("forget", "2", "9")
    assert (stranger.returncode, stranger.stderr) == (2, "lfa: id 9: must be one of the fleet's robots 1, 2, 3, 4\n")
    done = terminals.lfa("forget", "2", "3", "4")
    assert (done.returncode, done.stdout) == (0, "forgotten: robot2, robot3, robot4; robot1 leads\n"), done.stderr
    again = terminals.lfa("forget", "3")
    assert again.stdout == "robot1 leads: who is silent leaves its voters without being forgotten\n"


def test_who_holds_another_mission_than_its_team_ends_in_one_line(terminals: Terminals, tmp_path: Path) -> None:
    """E25: another profile, other robots, another version; with the team's own mission it is taken in."""
    team = msgspec.to_builtins(structs.replace(load("straight").mission, robots=(1, 2, 3)))

    def start(**other: object) -> subprocess.Popen[str]:
        file = tmp_path / f"{len(list(tmp_path.iterdir()))}.json"
        file.write_text(json.dumps(team | other))
        robot = ("lfa.agents.cli", "--role", "follower", "--id", "3", "--mission", str(file))
        return terminals.start(*robot, *terminals.team())

    terminals.router()
    terminals.world(robots=3)
    terminals.agent(1)
    terminals.agent(2)
    terminals.look_on()
    waits = "waiting for robot3"
    eventually(lambda: any(isinstance(m, Status) and m.text == waits for m in terminals.heard()), waits)
    for other, line in (
        ({"profile": "wifi"}, "mission.profile = wifi: must be std"),
        ({"robots": [1, 2, 3, 4]}, "mission.robots = [1, 2, 3, 4]: must be [1, 2, 3]"),
        ({"version": 2}, "mission.version = 2: must be 1"),
    ):
        odd = start(**other)
        _, said = odd.communicate(timeout=30.0)
        *events, reason = said.splitlines()  # on a busy machine it also says what it missed
        assert any(" robot3 mission " in event for event in events)
        assert (odd.returncode, reason) == (2, f"lfa-agent: {line}, which witness, robot1, robot2 hold")
    start()
    eventually(lambda: follows(terminals, "robot3"), "robot 3 follows nobody with the team's mission")


def test_systemd_hears_when_an_agent_is_ready_and_that_its_loop_turns(terminals: Terminals) -> None:
    terminals.router()
    with (
        tempfile.TemporaryDirectory(prefix="lfa-") as folder,
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd,
    ):
        systemd.bind(f"{folder}/notify")
        systemd.settimeout(20.0)
        terminals.agent(1, environment={"NOTIFY_SOCKET": f"{folder}/notify"})
        heard = [systemd.recv(64) for _ in range(3)]
    assert heard == [b"READY=1", b"WATCHDOG=1", b"WATCHDOG=1"]
