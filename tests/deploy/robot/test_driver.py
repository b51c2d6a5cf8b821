"""A real robot's driver: what passes its gateway moves it, and it brakes by its own clock when nothing passes."""

from __future__ import annotations

import subprocess
import sys
from math import inf, isclose

import pytest

from lfa.deploy.robot.base import Reading, SimulatedBase
from lfa.deploy.robot.driver import PERIOD_S, Driver
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import STILL, Pose2D, Twist
from lfa.protocol.lease.timing import timing_of
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Fence, Fenced, LeaseNote, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel, LaserScan, Localization, Sensors
from lfa.protocol.messages.stop import NEVER_STOPPED
from lfa.protocol.messages.team import Ask, Event, MissionNote
from lfa.protocol.mission import Leading, Limits, Mission
from lfa.protocol.node import PeerDown, Received, RouterLost, Stop
from tests.test_imports import NEVER_ON_A_ROBOT

MISSION = Mission(robots=(1, 2, 3), leading=Leading(route_m=((5.0, 0.0),)))
TIMING = timing_of(MISSION.profile)
TERM = Term(5, 1, 1)
GO = Twist(0.4, 0.1)


class Bench:
    """A driver of robot 2 on virtual time, and all that it has said."""

    def __init__(self) -> None:
        self.now = 10.0
        self.said: list[tuple[str, Message]] = []
        self.reports: list[float] = []
        self.driver = Driver("f", 2, 1, self._make, self.reports.append)
        self.base: SimulatedBase | None = None

    def _make(self, limits: Limits, now: float) -> SimulatedBase:
        self.base = SimulatedBase(Pose2D(1.0, 2.0, 0.0), limits, now)
        return self.base

    def hear(self, key: str, message: object) -> None:
        sent = self.driver.receive(Received(self.now, key, message))  # type: ignore[arg-type]
        self.said += [(envelope.key, envelope.message) for envelope in sent]

    def begin(self) -> Bench:
        """Told its mission, and beyond the time in which a new gateway is shut."""
        self.hear("lfa/f/world/mission", MissionNote(Header("world", 1, 1, 0.0), MISSION))
        return self.run(TIMING.grant_s + 0.1)

    def run(self, for_s: float, twist: Twist | None = None, term: Term = TERM, as_leader: bool = False) -> Bench:
        """So long, with a command in every period when there is a `twist`."""
        until = self.now + for_s
        while self.now < until:
            self.now = max(self.now, self.driver.next_deadline())
            self.said += [(e.key, e.message) for e in self.driver.tick(self.now)]
            if twist is not None:
                stamp = self.last(Sensors).gateway
                header = Header("robot2", 1, 1, self.now)
                self.hear(
                    "lfa/f/robot2/cmd_vel",
                    CmdVel(header, twist, term, 1, as_leader, stamp, NEVER_STOPPED, TIMING.grant_s),
                )
        return self

    def all(self, kind: type) -> list[Message]:
        return [message for _, message in self.said if isinstance(message, kind)]

    def last(self, kind: type) -> Sensors:
        found = self.all(kind)[-1]
        assert isinstance(found, Sensors)
        return found


def test_without_a_mission_it_asks_for_one() -> None:
    bench = Bench().run(1.5)
    assert [(key, type(message)) for key, message in bench.said] == [("lfa/f/driver2/ask", Ask)] * 3


def test_a_robot_that_is_not_in_the_mission_is_refused() -> None:
    driver = Driver("f", 9, 1, lambda limits, now: SimulatedBase(Pose2D(), limits, now))
    driver.receive(Received(1.0, "lfa/f/world/mission", MissionNote(Header("world", 1, 1, 0.0), MISSION)))
    assert driver.refusal is not None and "id 9" in driver.refusal


def test_it_says_what_an_agent_needs_at_the_rates_of_the_table() -> None:
    bench = Bench().begin()
    bench.said.clear()
    bench.run(2.0)
    assert abs(len(bench.all(Sensors)) - 100) <= 1
    assert abs(len(bench.all(Localization)) - 20) <= 1
    scans = bench.all(LaserScan)
    assert abs(len(scans) - 20) <= 1
    assert all(isinstance(scan, LaserScan) and set(scan.ranges_m) == {inf} for scan in scans)
    assert {key for key, _ in bench.said} == {f"lfa/f/robot2/{topic}" for topic in ("sensors", "localization", "scan")}


def test_commands_move_it_as_far_as_odometry_and_localisation_say() -> None:
    bench = Bench().begin().run(2.0, GO)
    fix = bench.all(Localization)[-1]
    assert isinstance(fix, Localization)
    assert bench.last(Sensors).twist == GO
    assert 0.5 < fix.pose_map.x - 1.0 < 0.8 and fix.pose_map.y > 2.0
    assert isclose(bench.last(Sensors).odometer_m, 2.0 * 0.4 - 0.4 * 0.4 / 2.0, abs_tol=0.05)


def test_it_brakes_within_the_deadman_after_the_last_command() -> None:
    bench = Bench().begin().run(2.0, GO)
    assert bench.base is not None
    silent_since = bench.now
    while bench.base._wanted != STILL:
        bench.run(PERIOD_S)
    assert bench.now - silent_since <= TIMING.deadman_s + 2.0 * PERIOD_S
    before = bench.last(Sensors).odometer_m
    bench.run(1.0)
    assert bench.last(Sensors).twist == STILL
    assert bench.last(Sensors).odometer_m - before <= 0.4 * 0.4 / 2.0 / MISSION.limits.a_max_mps2 + 0.05


def test_a_command_that_echoes_no_moment_of_this_gateway_moves_nothing() -> None:
    bench = Bench().begin()
    stamp = bench.last(Sensors).gateway
    old = type(stamp)(stamp.incarnation + 1, stamp.time)
    bench.hear(
        "lfa/f/robot2/cmd_vel",
        CmdVel(Header("robot2", 1, 1, bench.now), GO, TERM, 1, False, old, grant_s=TIMING.grant_s),
    )
    bench.run(0.2)
    assert bench.last(Sensors).odometer_m == 0.0
    assert bench.last(Sensors).refused == 1


def test_a_fence_is_answered_and_nothing_below_it_moves_the_robot() -> None:
    bench = Bench().begin().run(0.5, GO)
    fence = Fence(TERM, Term(6, 3, 1))
    bench.hear("lfa/f/robot3/lease/gateway2", LeaseNote(Header("robot3", 1, 1, 0.0), fence))
    key, note = bench.said[-1]
    assert key == "lfa/f/robot2/lease/all" and isinstance(note, LeaseNote)
    assert (note.header.sender, note.body) == ("robot2", Fenced(fence.old, fence.term))
    bench.run(1.0, GO)
    assert bench.last(Sensors).twist == STILL
    assert bench.last(Sensors).term_max == fence.term


def test_an_agent_that_left_the_wire_bars_its_own_leader_commands() -> None:
    bench = Bench().begin().run(0.2, GO, Term(5, 2, 1))
    bench.hear("lfa/f/robot2/alive/1", PeerDown("robot2", 1))
    bench.run(0.1)
    assert bench.last(Sensors).latched


def test_a_router_that_is_lost_says_nothing_about_the_agent() -> None:
    bench = Bench().begin().run(0.2, GO)
    bench.hear("", RouterLost())
    bench.hear("lfa/f/robot2/alive/1", PeerDown("robot2", 1))
    bench.run(0.1)
    assert not bench.last(Sensors).latched


def test_each_term_in_which_it_leads_is_one_event() -> None:
    bench = Bench().begin()
    for n in (5, 6):
        stamp, term = bench.last(Sensors).gateway, Term(n, 2, 1)
        for _ in range(3):
            header = Header("robot2", 1, 1, bench.now)
            bench.hear("lfa/f/robot2/cmd_vel", CmdVel(header, GO, term, 2, True, stamp, NEVER_STOPPED, TIMING.grant_s))
    events = [m for m in bench.all(Event) if isinstance(m, Event) and m.kind == "leader_command"]
    assert [(event.term, event.data) for event in events] == [(Term(n, 2, 1), {"robot": 2}) for n in (5, 6)]


def test_hardware_that_raises_hears_a_stop_last() -> None:
    """A driver whose serial line breaks ends; its wheels must not keep the last command."""
    bench = Bench().begin().run(0.5, GO)
    base = bench.base
    assert base is not None and base._wanted == GO

    def broken(_now: float) -> Reading:
        raise OSError(5, "serial line gone")

    base.read = broken  # type: ignore[method-assign]
    with pytest.raises(OSError, match="serial line gone"):
        bench.driver.tick(bench.driver.next_deadline())
    assert base._wanted == STILL


def test_wheels_without_a_watchdog_stop_at_once() -> None:
    """The process may need seconds to end: to close a link to a router that hangs."""
    bench = Bench().begin().run(0.5, GO)

    def ended(_now: float) -> None:
        raise Refused("the watchdog process has ended")

    bench.driver._alive = ended
    with pytest.raises(Refused):
        bench.driver.tick(bench.driver.next_deadline())
    assert bench.base is not None and bench.base._wanted == STILL


def test_motors_whose_driver_hangs_brake_by_themselves() -> None:
    base = SimulatedBase(Pose2D(), Limits(), 0.0)
    for n in range(100):
        base.drive(Twist(0.5, 0.0), 0.02 * n)
    before = base.read(2.0)
    after = base.read(12.0)
    assert after.twist == STILL
    braking_m = 0.5 * 0.5 / (2.0 * Limits().a_max_mps2)
    assert after.odometer_m - before.odometer_m < 0.5 * SimulatedBase.COMMAND_S_MAX + braking_m + 0.02


def test_it_reports_each_period_in_which_the_hardware_answered() -> None:
    bench = Bench().begin().run(1.0, GO)
    assert len(bench.reports) >= 50


def test_told_to_stop_it_brakes_and_is_done() -> None:
    bench = Bench().begin().run(1.0, GO)
    bench.hear("", Stop())
    assert bench.driver.finished and bench.base is not None and bench.base._wanted == STILL


def test_a_driver_needs_the_base_install_only() -> None:
    unwanted = tuple(name for name in NEVER_ON_A_ROBOT if name != "lfa.deploy")
    code = f"import lfa.deploy.robot.cli, sys; print([name for name in {unwanted} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("at", ["1,2", "a,b,c", "", "nan,0,0"])
def test_a_place_that_is_none_is_refused_in_one_line(at: str) -> None:
    command = [sys.executable, "-P", "-m", "lfa.deploy.robot.cli", "--id", "2", f"--at={at}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "must be x,y,theta" in done.stderr
