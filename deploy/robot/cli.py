"""`lfa-driver`: the driver of one robot as one process, with a simulated motor; the example for your own.

Like an agent it needs the base install only.
"""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # noqa: F401 (before any other module)

# isort: split
import argparse
import os
import shlex
import shutil
import sys
from math import isfinite
from pathlib import Path
from typing import Any, NoReturn

from msgspec import structs

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

ROS_ROUTER = "tcp/127.0.0.1:7447"
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
    fleet = fleet_name(arguments.fleet)
    start_map = None if arguments.at is None else _pose("--at", arguments.at)
    if arguments.ros is not None:
        return _start_ros(arguments, fleet, start_map)

    def make_base(limits: Limits, now: float) -> SimulatedBase:
        return SimulatedBase(start_map or Pose2D(), limits, now)

    watchdog = () if arguments.stop_command is None else (_watchdog(arguments.stop_command).alive,)
    driver = Driver(fleet, arguments.id, incarnations.drawn(), make_base, *watchdog, spare=arguments.spare)
    return _run(driver, arguments, fleet)


def _start_ros(arguments: argparse.Namespace, fleet: str, start_map: Pose2D | None) -> int:
    """Drive a ROS 2 robot. The ROS side is imported here: other drivers need the base install only."""
    try:
        from lfa.deploy.robot.ros_open import RosOptions, RosRobot
        from lfa.deploy.robot.ros_presets import load_preset
    except ModuleNotFoundError as error:
        raise Refused(f"--ros needs {error.name}: install with: pip install 'lfa[ros]'") from None
    laser = None if arguments.laser is None else _pose("--laser", arguments.laser)
    changed: dict[str, Any] = {
        "odom": arguments.odom,
        "scan": arguments.scan,
        "cmd_vel": arguments.cmd_vel,
        "laser": None if laser is None else (laser.x, laser.y, laser.theta),
    }
    names = structs.replace(load_preset(arguments.robot), **{k: v for k, v in changed.items() if v is not None})
    namespace = None if arguments.namespace is None else arguments.namespace.rstrip("/")
    robot = RosRobot(
        RosOptions(arguments.ros, arguments.domain, namespace, names, arguments.robot_stops_by_itself),
        start_map,
    )
    try:
        number, spare = incarnations.drawn(), arguments.spare
        driver = Driver(fleet, arguments.id, number, robot.make_base, robot.alive, spare=spare)
        return _run(driver, arguments, fleet)
    finally:
        robot.close()


def _run(driver: Driver, arguments: argparse.Namespace, fleet: str) -> int:
    """Run the driver until it is stopped; its last command is a stop."""
    wall_ms = clock.wall_ms()
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


def _pose(option: str, text: str) -> Pose2D:
    try:
        x, y, theta = (float(part) for part in text.split(","))
        fine = all(map(isfinite, (x, y, theta)))
    except ValueError:
        fine = False
    if not fine:
        raise Refused(f"{option} {text}: must be x,y,theta [m, m, rad], like 0,-2.4,0")
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
    add("--at", metavar="X,Y,THETA", help="start pose in map [m, m, rad]; default 0,0,0, with --ros none")
    add("--spare", action="store_true", help="a robot that the mission does not name: it waits for lfa join")
    add("--fleet", default="fleet", help="name of the fleet, part of every key (default: %(default)s)")
    add("--connect", metavar="ENDPOINT", help="router, as tcp/127.0.0.1:7450; a,b: tried in turn")
    add("--keys", type=Path, metavar="DIR", help="this machine's key folder from `lfa keys`")
    add("--stop-command", metavar="COMMAND", help="stops the motors; a second process runs it when this one is silent")
    add("--link", choices=sorted(LINK_LEASES_MS), default="std", help="timeout of a silent link: 0.5, 1 or 2 s")
    ros = parser.add_argument_group("ROS 2 robots", "a robot on the network of rmw_zenoh; needs pip install 'lfa[ros]'")
    add = ros.add_argument
    add("--ros", nargs="?", const=ROS_ROUTER, metavar="ENDPOINT", help="drive a ROS robot; its router (%(const)s)")
    add(
        "--robot", default="turtlebot3", metavar="NAME", help="turtlebot3, turtlebot4, create3, clearpath, nav2, F.toml"
    )
    add("--namespace", metavar="/NAME", help="the robot's namespace; default the only robot found")
    add("--domain", type=int, help="ROS_DOMAIN_ID; default that of the only robot found")
    add("--odom", metavar="TOPIC", help="instead of the preset's")
    add("--scan", metavar="TOPIC", help="instead of the preset's")
    add("--cmd-vel", metavar="TOPIC", help="instead of the preset's; Twist or TwistStamped is found")
    add("--laser", metavar="X,Y,YAW", help="mount of the scanner in the base frame; default from /tf_static")
    add("--robot-stops-by-itself", action="store_true", help="allow a link to another machine before the wheels")
    return parser


if __name__ == "__main__":
    main()
