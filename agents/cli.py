"""`lfa-agent`: runs one robot, or the witness, as one process.

The command line is parsed by argparse: the library that parses the command line of `lfa` would take half of an agent's
resident memory.
"""

from __future__ import annotations

import lfa.protocol.program_start.installed_first  # isort: skip  # before any other module
import lfa.protocol.program_start.lean_msgspec  # isort: skip  # noqa: F401

# isort: split
import argparse
import os
import signal
import sys
from pathlib import Path
from typing import Any, NoReturn

from lfa.agents.agent import Agent
from lfa.agents.behaviors.own_behavior import BEHAVIORS
from lfa.agents.following.plugin import add_controller_file
from lfa.protocol import clock, incarnations
from lfa.protocol.config_file.mistake import FileError, RefusedFile, apply_rules
from lfa.protocol.errors import Refused
from lfa.protocol.file_reading import DamagedFile, read_json
from lfa.protocol.mission import Mission
from lfa.protocol.mission_checks import MISSION_RULES
from lfa.protocol.names import whole_number
from lfa.protocol.node import Node
from lfa.protocol.output import write_line
from lfa.protocol.runtime.node_runner import Options, run
from lfa.protocol.topics import fleet_name
from lfa.protocol.transport.credentials import credentials
from lfa.protocol.transport.zenoh_config import LINK_LEASES_MS, default_endpoint
from lfa.protocol.witness import Witness

ROLES = ("leader", "follower", "witness")
EXAMPLE = "example: lfa-agent --role follower --id 2"
RIGHT_MISSION = "must be the [mission] of a scenario in a file of its own, without that heading, in TOML or JSON"
_MISSION = "mission"


def main() -> None:
    """Run the entry point of `lfa-agent`: exit code 0 after a normal end, 2 after a refusal."""
    try:
        sys.exit(start(_parser().parse_args()))
    except Refused as refused:
        for line in refused.lines:
            write_line(f"lfa-agent: {line}", sys.stderr)
        sys.exit(2)


def start(arguments: argparse.Namespace) -> int:
    """Run one robot of a fleet until it is stopped (Ctrl-C or SIGTERM). Raise `Refused`."""
    if arguments.controller is not None:
        add_controller_file(arguments.controller)
    for own_code in arguments.behavior:
        BEHAVIORS.add_file(own_code)
    mission = None if arguments.mission is None else read_mission(arguments.mission)
    endpoint = arguments.connect or default_endpoint()
    if arguments.lockstep is not None:
        return _granted(arguments, endpoint, mission)
    fleet, wall_ms = fleet_name(arguments.fleet), clock.wall_ms()
    node = _node(arguments.role, arguments.id, fleet, wall_ms, mission, arguments.spare, incarnations.drawn())
    known = None if arguments.keys is None else credentials(arguments.keys, node.name, wall_ms)
    lease_ms = LINK_LEASES_MS[arguments.link]
    notify = os.environ.get("NOTIFY_SOCKET", "")
    options = Options(fleet, endpoint, arguments.journal, arguments.faults, lease_ms, known, notify)
    return run([node], options, wall_ms)


def _granted(arguments: argparse.Namespace, endpoint: str, mission: Mission | None) -> int:
    """Run one robot of a lockstep run, in granted time. Raise `Refused`."""
    # Imported here: most agents keep their own time, and memory is short on a robot.
    from lfa.protocol.runtime.granted_time import run_granted
    from lfa.protocol.transport.zenoh_grants import GrantLink

    incarnation = whole_number(arguments.lockstep) or 0
    if incarnation < 1:
        raise Refused(f"--lockstep {arguments.lockstep}: must be the number of a start, 1 or higher")
    fleet = fleet_name(arguments.fleet)
    node = _node(arguments.role, arguments.id, fleet, incarnation, mission, arguments.spare, incarnation)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)  # nothing is left to say: the run has the journal
    return run_granted(node, GrantLink(endpoint, fleet, node.name, incarnation))


class _AgentParser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Raise `Refused` with one line, where argparse would print its usage and a line."""
        raise Refused(f"{message} ({EXAMPLE})")


def _parser() -> argparse.ArgumentParser:
    parser = _AgentParser(prog="lfa-agent", description="Run one robot of a fleet until it is stopped.", epilog=EXAMPLE)
    add = parser.add_argument
    # fmt: off
    add("--role", required=True, help="initial role: leader, follower or witness; roles change at run time")
    add("--id", required=True, help="robot id from the mission (1, 2, ...), or w for the witness")
    add("--fleet", default="fleet", help="name of the fleet, part of every key (default: %(default)s)")
    add("--connect", metavar="ENDPOINT", help="the router, such as tcp/127.0.0.1:7450 (default: this machine's); a,b: "
        "the first that answers, the next one when it is lost")
    add("--keys", type=Path, metavar="DIR", help="this machine's folder of `lfa keys`, with the robot's certificate")
    add("--link", choices=sorted(LINK_LEASES_MS), default="std",
        help="time after which a silent link counts as lost: fast (0.5 s), std (1 s), wifi or auto (2 s)")
    add("--mission", type=Path, metavar="FILE", help="mission as JSON or TOML; without it, received over Zenoh")
    add("--spare", action="store_true", help="a robot that the mission does not name: it waits for lfa join")
    add("--journal", type=Path, metavar="DIR", help="folder for the journal of inputs")
    add("--controller", metavar="FILE",
        help="a controller of your own, FILE.py:Class or FILE.onnx, for a mission that chooses it")
    add("--behavior", metavar="FILE.py:Class", action="append", default=[],
        help="a behaviour of your own, for a mission that names it; repeatable")
    add("--faults", action="store_true", help="obey an operator's link conditions (lfa fault cut, loss): for tests")
    add("--lockstep", metavar="START", help="take time and messages from `lfa run --lockstep`, which starts its "
        "agents so; START counts the robot's starts from 1")
    # fmt: on
    return parser


def _node(role: str, id: str, fleet: str, wall_ms: int, mission: Mission | None, spare: bool, incarnation: int) -> Node:
    if role not in ROLES:
        raise Refused(f"--role {role}: must be one of {', '.join(ROLES)}")
    if role == "witness":
        if id not in ("w", "0"):
            raise Refused(f"--id {id}: the witness is w")
        return Witness(fleet, incarnation, wall_ms, mission)
    robot = whole_number(id) or 0
    if not 1 <= robot <= 2**31:
        raise Refused(f"--id {id}: must be a robot's number, 1 or higher")
    if mission is not None and robot not in mission.robots and not spare:
        raise Refused(f"--id {id}: not in the mission, which has robots {list(mission.robots)}")
    return Agent(robot, incarnation, fleet, wall_ms, mission, spare=spare)


def read_mission(path: Path) -> Mission:
    """Return the mission of a JSON or TOML file. Raise `Refused` with every mistake: key, value, and what is right."""
    # Imported here: most agents receive their mission over Zenoh, and memory is short on a robot.
    from lfa.protocol.config_file.conversion import convert
    from lfa.protocol.config_file.toml_file import read_toml

    right = "the [mission] of a scenario in a file of its own, without that heading,"
    toml = None if path.suffix == ".json" else read_toml(path, right).under(_MISSION)
    document = _read_json_mission(path) if toml is None else toml.document
    mission, mistakes = convert(document, Mission, where=_MISSION)
    apply_rules(MISSION_RULES, mission, mistakes)
    if mistakes and toml is not None:
        raise toml.refuse(mistakes)
    if mistakes:  # of JSON no lines are known
        raise RefusedFile(FileError(str(path), str(mistake), key=mistake.key) for mistake in mistakes)
    return mission


def _read_json_mission(path: Path) -> dict[str, Any]:
    from lfa.protocol.config_file.conversion import without_nulls

    try:
        return without_nulls(read_json(path, dict[str, Any]))
    except DamagedFile as error:
        raise Refused(f"--mission {path}: {error}: {RIGHT_MISSION}") from None
    except OSError as error:
        raise Refused(f"--mission {path}: {error.strerror}: {RIGHT_MISSION}") from None


if __name__ == "__main__":
    main()
