"""The bytes of outgoing messages: those of `rosbags`' serializer, and of genuine nodes."""

from __future__ import annotations

import subprocess
import sys
from math import atan2, inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfa.deploy.ros import markers, messages
from lfa.deploy.ros.cdr import NS, SECONDS_MAX, CdrMessage, CdrWriter
from lfa.deploy.ros.explored import MapCells
from lfa.deploy.ros.markers import ObstacleMark, RobotMark
from lfa.deploy.ros.types import from_cdr, to_cdr
from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.robot import LaserScan
from tests.deploy.ros.test_mapping import header, status
from tests.deploy.ros.test_types import SAMPLES

NUMBERS = st.floats(-1e9, 1e9)
STAMPS = st.integers(0, 2**62)
PLACES = st.builds(Pose2D, NUMBERS, NUMBERS, st.floats(-4.0, 4.0))
TWISTS = st.builds(Twist, NUMBERS, NUMBERS)
WORDS = st.text(max_size=20)
FRAMES = WORDS.filter(lambda words: "\0" not in words)
RANGES = st.lists(st.floats(), max_size=9)
ROBOTS = st.builds(
    RobotMark, st.integers(1, 3), st.sampled_from(["leader", "follower", "?"]), PLACES, st.none() | PLACES,
    st.none() | st.integers(1, 3),
)  # fmt: skip
BODIES = st.builds(ObstacleMark, NUMBERS, NUMBERS, NUMBERS)
GRIDS = st.builds(
    lambda cell_m, columns, rows: MapCells(cell_m, (1.0, -2.0), columns, bytes(range(columns)) * rows),
    st.floats(0.001, 10.0), st.integers(1, 9), st.integers(1, 9),
)  # fmt: skip
EXAMPLES = st.one_of(
    st.builds(messages.odometry, STAMPS, PLACES, TWISTS, NUMBERS, FRAMES, FRAMES),
    st.builds(lambda stamp, ranges, frame: messages.laser_scan(
        stamp, LaserScan(header(), -1.0, 0.1, 0.1, 9.0, tuple(ranges)), frame), STAMPS, RANGES, FRAMES),
    st.builds(messages.pose_stamped, STAMPS, PLACES),
    st.builds(messages.twist, TWISTS),
    st.builds(messages.twist_stamped, STAMPS, TWISTS, FRAMES),
    st.builds(messages.tf, st.lists(st.builds(messages.Transform, STAMPS, FRAMES, FRAMES, PLACES), max_size=4)),
    st.builds(messages.path, STAMPS, st.lists(PLACES, max_size=4)),
    st.builds(messages.occupancy_grid, STAMPS, GRIDS),
    st.builds(messages.clock, STAMPS),
    st.builds(messages.text, FRAMES),
    st.builds(messages.number, st.integers(0, 2**60)),
    st.builds(messages.log, STAMPS, st.sampled_from(["info", "error"]), FRAMES, FRAMES),
    st.builds(messages.answer_of_service, st.booleans(), FRAMES),
    st.builds(lambda stamp, error_m: messages.diagnostics(
        stamp, [messages.diagnosis(robot, status(), error_m, 1) for robot in ("robot1", "robot22")]), STAMPS, NUMBERS),
    st.builds(markers.formation, STAMPS, st.lists(ROBOTS, max_size=3), st.lists(BODIES, max_size=2)),
)  # fmt: skip


@given(EXAMPLES)
def test_every_message_has_the_bytes_that_rosbags_writes(message: CdrMessage) -> None:
    assert to_cdr(from_cdr(message.payload, message.type)) == message.payload


@pytest.mark.parametrize("payload", [payload for name, payload in SAMPLES if name == "nav_msgs/msg/Odometry"])
def test_the_odometry_of_a_genuine_node_is_written_as_it_wrote_it_but_for_what_it_is_sure_of(payload: bytes) -> None:
    genuine = from_cdr(payload, "nav_msgs/msg/Odometry")
    at, turn, twist = genuine.pose.pose.position, genuine.pose.pose.orientation, genuine.twist.twist
    place, moves = Pose2D(at.x, at.y, 2.0 * atan2(turn.z, turn.w)), Twist(twist.linear.x, twist.angular.z)
    stamp_ns = genuine.header.stamp.sec * NS + genuine.header.stamp.nanosec
    ours = messages.odometry(stamp_ns, place, moves, 0.0, genuine.header.frame_id, genuine.child_frame_id)
    told = from_cdr(ours.payload, ours.type)
    genuine.pose.covariance, genuine.twist.covariance = told.pose.covariance, told.twist.covariance
    assert to_cdr(genuine) == ours.payload


def test_a_range_beyond_single_precision_is_infinite_and_none_is_lost() -> None:
    told = from_cdr(messages.laser_scan(0, LaserScan(header(), 0, 0, 0, 9, (1e39, -inf, nan, 2.0)), "s").payload,
                    "sensor_msgs/msg/LaserScan")  # fmt: skip
    assert [str(one) for one in told.ranges.tolist()] == ["inf", "-inf", "nan", "2.0"]


@pytest.mark.parametrize("stamp_ns", [-(10**30), -1, 10**30])
def test_a_time_that_ros_cannot_say_is_written_as_the_last_one_that_it_can(stamp_ns: int) -> None:
    told = from_cdr(messages.clock(stamp_ns).payload, "rosgraph_msgs/msg/Clock").clock
    assert abs(told.sec) <= SECONDS_MAX


def test_numbers_lie_at_multiples_of_their_size() -> None:
    written = CdrWriter().int8(1).int32(2).int8(3).float64(0.0).bytes()
    assert written == bytes([1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0]) + bytes(8)


def test_a_bridge_that_only_tells_loads_neither_numpy_nor_the_library_of_types() -> None:
    code = "import lfa.deploy.ros.bridge.command, sys; print([m for m in ('numpy', 'rosbags') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
