"""`lfa bench world`: processor time of the world per second, for physics, sensors, terrain and messages.

In process, the world runs in its own time: encoded commands in, encoded messages out, without journal and transport.
With `--processes` the world's process of a real run is measured too, with transport and journal.
"""

from __future__ import annotations

from collections.abc import Iterator
from time import process_time

from msgspec.structs import replace

from lfa.deploy.bench.harness.rows import BenchRow, Quantity, row, show
from lfa.deploy.bench.harness.team import Team
from lfa.deploy.process.identity import cpu_s
from lfa.protocol import clock
from lfa.protocol.geometry import Twist
from lfa.protocol.lease.timing import timing_for
from lfa.protocol.messages.codec import encode
from lfa.protocol.messages.consensus import GatewayStamp, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel
from lfa.protocol.messages.stop import NEVER_STOPPED
from lfa.protocol.names import robot_name
from lfa.protocol.runtime.journal import JOURNAL_VERSION, Heading, Journal
from lfa.protocol.runtime.node_host import NodeHost
from lfa.protocol.topics import WORLD_NAME, key
from lfa.world.description.load import Scenario, draw, load
from lfa.world.description.scenario import Lidar
from lfa.world.world import World

BARS = {4: 15.0, 20: 60.0}
"""Maximum share of a core [%] by number of robots, with 180 beams at 10 Hz (issue: the world)."""
SIMULATED_S = 10.0
COMMAND_S = 0.02
REAL_S = 10.0
FLEET, TERM = "bench", Term(5, 1, 1)


def run(as_json: bool, processes: bool = False) -> int:
    """Print the rows; return 0 if all hold, else 1."""
    return show(_rows(processes), as_json)


def scenario_of(robots: int) -> Scenario:
    """Return the shipped scenario `terrain`, which has all kinds of terrain, drawn with seed 1."""
    scenario = load("terrain", ["time_limit_s=100000"], robots)
    return draw(replace(scenario, world=replace(scenario.world, lidar=Lidar(beams=180, rate_hz=10.0))), 1)


def _rows(processes: bool) -> Iterator[list[BenchRow]]:
    for robots, bar in BARS.items():
        share = 100.0 * simulated(scenario_of(robots))
        yield [row(f"world/{robots} robots", Quantity("in process", "%", bar), share)]
    for robots, bar in BARS.items() if processes else ():
        yield [row(f"world/{robots} robots", Quantity("as a process", "%", bar), 100.0 * _real(scenario_of(robots)))]


def simulated(scenario: Scenario) -> float:
    """Return the processor time [s] per second of the world's time, with every robot driving and turning."""
    world = World(FLEET, scenario, 1, 1, start_at=0.0)
    host = NodeHost(world, Journal(None, Heading(JOURNAL_VERSION, WORLD_NAME, 1, 0, {})))
    now, number = 0.0, 0
    shut_s = timing_for(scenario.mission).grant_s + COMMAND_S
    began: float | None = None
    while now < shut_s + SIMULATED_S:
        if began is None and now >= shut_s:
            began = process_time()
        now = world.next_deadline()
        host.tick(now)
        if round(now / COMMAND_S) > number:
            number = round(now / COMMAND_S)
            for robot in scenario.mission.robots:
                host.message(now, key(FLEET, robot_name(robot), "cmd_vel"), _command(scenario, robot, number, now))
    assert began is not None
    return (process_time() - began) / SIMULATED_S


def _command(scenario: Scenario, robot: int, number: int, now: float) -> bytes:
    """Return an encoded command to drive ahead while weaving; robots climb terrain, get stuck, and push each other."""
    turn = 0.3 if (number // 50 + robot) % 2 else -0.3
    first = scenario.mission.robots[0]
    header = Header(robot_name(robot), 1, number, now)
    stamp, grant_s = GatewayStamp(1, now), timing_for(scenario.mission).grant_s
    return encode(CmdVel(header, Twist(0.4, turn), TERM, first, robot == first, stamp, NEVER_STOPPED, grant_s))


def _real(scenario: Scenario) -> float:
    with Team(scenario) as team:
        team.await_chain(len(scenario.mission.robots))
        process = team.process_of(WORLD_NAME)
        began, used = clock.now(), cpu_s(process)
        team.wait_until(lambda: clock.now() >= began + REAL_S, "the clock stands", 2.0 * REAL_S)
        return (cpu_s(process) - used) / (clock.now() - began)
