"""`lfa-driver`: the driver of one robot as one process, with a simulated motor; the example for your own.

Like an agent it needs the base install only.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import sys
from math import isfinite
from pathlib import Path
from typing import NoReturn

from lfa.deploy.robot.base import SimulatedBase
from lfa.deploy.robot.driver import Driver
from lfa.deploy.robot.watchdog import Watchdog
from lfa.protocol import clock, incarnations
from lfa.protocol.errors import Refused
from lfa.protocol.geometry import Pose2D
from lfa.protocol.mission import Limits
from lfa.protocol.output import write_line
from lfa.protocol.runtime.node_runner import Options, run
from lfa.protocol.topics import fleet_name
from lfa.protocol.transport.credentials import credentials
from lfa.protocol.transport.zenoh_config import LINK_LEASES_MS, default_endpoint

EXAMPLE = "example: lfa-driver --id 3 --at 0,-2.4,0 (beside lfa-world SCENARIO --set world.real_robots=[3])"


def main() -> None:
    """Run `lfa-driver` (entry point); exit code 0 after a normal end, 2 when refused."""
    try:
        sys.exit(start(_parser().parse_args()))
    except Refused as refused:
        write_line(f"lfa-driver: {refused}", sys.stderr)
        sys.exit(2)


def start(arguments: argparse.Namespace) -> int:
    """Drive one robot until stopped (Ctrl-C or SIGTERM). Raises `Refused`."""
    if not 1 <= arguments.id <= 2**31:
        raise Refused(f"--id {arguments.id}: must be a robot's number, 1 or higher")
    start_map, wall_ms = _pose(arguments.at), clock.wall_ms()

    def make_base(limits: Limits, now: float) -> SimulatedBase:
        return SimulatedBase(start_map, limits, now)

    fleet = fleet_name(arguments.fleet)
    watchdog = () if arguments.stop_command is None else (_watchdog(arguments.stop_command).alive,)
    driver = Driver(fleet, arguments.id, incarnations.drawn(), make_base, *watchdog)
    known = None if arguments.keys is None else credentials(arguments.keys, driver.name, wall_ms)
    endpoint = arguments.connect or default_endpoint()
    notify = os.environ.get("NOTIFY_SOCKET", "")
    options = Options(
        fleet,
        endpoint,
        None,
        False,
        LINK_LEASES_MS[arguments.link],
        known,
        notify,
    )
    try:
        return run([driver], options, wall_ms)
    finally:
        driver.brake(clock.now())


def _watchdog(command: str) -> Watchdog:
    words = shlex.split(command)
    if not words or shutil.which(words[0]) is None:
        raise Refused(f"--stop-command {command!r}: must be a command that exists here and stops the motors")
    return Watchdog(words)


def _pose(text: str) -> Pose2D:
    try:
        x, y, theta = (float(part) for part in text.split(","))
        fine = all(map(isfinite, (x, y, theta)))
    except ValueError:
        fine = False
    if not fine:
        raise Refused(f"--at {text}: must be x,y,theta in map [m, m, rad], like 0,-2.4,0")
    return Pose2D(x, y, theta)


class _DriverParser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Raise Refused with one line instead of printing the usage."""
        raise Refused(f"{message} ({EXAMPLE})")


def _parser() -> argparse.ArgumentParser:
    parser = _DriverParser(
        prog="lfa-driver", description="Drive one robot's (simulated) motor until stopped.", epilog=EXAMPLE
    )
    add = parser.add_argument
    add("--id", required=True, type=int, help="the robot's id in the mission")
    add("--at", default="0,0,0", metavar="X,Y,THETA", help="start pose in map [m, m, rad]")
    add("--fleet", default="fleet", help="name of the fleet, part of every key (default: %(default)s)")
    add("--connect", metavar="ENDPOINT", help="router, as tcp/127.0.0.1:7447; a,b: tried in turn")
    add("--keys", type=Path, metavar="DIR", help="this machine's key folder from `lfa keys`")
    add("--stop-command", metavar="COMMAND", help="stops the motors; a second process runs it when this one is silent")
    add("--link", choices=sorted(LINK_LEASES_MS), default="std", help="timeout of a silent link: 0.5, 1 or 2 s")
    return parser


if __name__ == "__main__":
    main()
