"""Genuine ROS 2 (rclpy and its message packages): it reads our CDR, we read its, and it has the pinned hashes."""

from __future__ import annotations

import json
from math import inf
from pathlib import Path
from typing import Any

import pytest

from lfa.deploy.ros import markers, messages
from lfa.deploy.ros.cdr import NS
from lfa.deploy.ros.explored import MapCells
from lfa.deploy.ros.markers import ObstacleMark, RobotMark
from lfa.deploy.ros.types import HASHES, from_cdr, to_cdr, type_hash
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.consensus import Role
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.messages.team import Level, Status
from tests.deploy.ros.test_mapping import TERM, header
from tests.rigs import ros_values
from tests.rigs.foreign_peers import answer, start

pytestmark = pytest.mark.processes
T = 5 * NS + 7
AT = Pose2D(1.0, -2.0, 0.3)
NOT_IN_THE_WHEELS = {"tf2_msgs/msg/TFMessage"}


def examples() -> dict[str, Any]:
    """Return one filled message of each type that this project sends or reads."""
    scan = LaserScan(header(), -1.0, 0.5, 0.1, 10.0, (inf, 2.0, 3.0))
    status = messages.diagnosis("robot3", Status(header(), Level.WARN, "waits", Role.WAITING, TERM, {"x": 1.0}), 0.1, 1)
    found = [
        messages.odometry(T, AT, Twist(0.5, 0.1), 2.0, "odom", "base_link"),
        messages.laser_scan(T, scan, "base_scan"),
        messages.pose_stamped(T, AT),
        messages.twist(Twist(0.5, 0.1)),
        messages.twist_stamped(T, Twist(0.5, 0.1), "base_link"),
        messages.path(T, [AT, AT]),
        messages.occupancy_grid(T, MapCells(0.05, (1.0, 2.0), 3, bytes([0, 100, 255]))),
        messages.clock(T),
        messages.text("words"),
        messages.number(3),
        messages.log(T, "warn", "robot3", "contact"),
        messages.diagnostics(T, [status]),
        messages.tf([messages.Transform(T, "map", "odom", AT)]),
        markers.formation(
            T, [RobotMark(3, "follower", AT, AT, 2), RobotMark(2, "leader", AT)], [ObstacleMark(1, 2, 0.3)]
        ),
    ]
    located = ros_values.pose_with_covariance(T, AT, range(36))
    return {message.type: message for message in found} | {located.__msgtype__: located}


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    asked: dict[str, str | None] = dict.fromkeys(HASHES)
    asked |= {name: to_cdr(message).hex() for name, message in examples().items()}
    process = start("genuine", "genuine.py", home=tmp_path_factory.mktemp("home"))
    told: dict[str, Any] = json.loads(answer(process, json.dumps(asked)))
    return told


def test_there_is_an_example_of_every_message_type() -> None:
    assert set(examples()) == {name for name in HASHES if "/msg/" in name}


@pytest.mark.parametrize("name", sorted(set(HASHES) - NOT_IN_THE_WHEELS))
def test_the_pinned_hash_is_that_of_genuine_ros(name: str, answers: dict[str, Any]) -> None:
    assert answers[name]["hash"] == type_hash(name)


@pytest.mark.parametrize("name", sorted({name for name in HASHES if "/msg/" in name} - NOT_IN_THE_WHEELS))
def test_genuine_ros_reads_our_bytes_and_we_read_its(name: str, answers: dict[str, Any]) -> None:
    genuine = bytes.fromhex(answers[name]["cdr"])
    ours = to_cdr(examples()[name])
    assert len(genuine) == len(ours)
    assert to_cdr(from_cdr(genuine, name)) == ours, "decoded, as genuine nodes leave garbage in the padding"


def test_the_oracle_is_read_from_a_file_that_names_its_versions() -> None:
    assert all("==" in line for line in (Path(__file__).parent / "peers" / "genuine.txt").read_text().splitlines())
