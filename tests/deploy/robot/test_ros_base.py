"""A ROS robot as a driver's hardware: what it reads, when it is silent, what it warns of."""

from __future__ import annotations

import time
from collections.abc import Iterator
from math import inf, isfinite, nan, pi
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lfa.agents.localization.plausibility import plausible
from lfa.deploy.robot.ros_base import ODOM_S_MAX, RosBase
from lfa.deploy.robot.ros_frames import FrameTree
from lfa.deploy.robot.ros_presets import RosPreset
from lfa.deploy.ros import messages
from lfa.deploy.ros.session import NodeHandle, RosSpace
from lfa.deploy.ros.types import from_cdr, to_cdr
from lfa.deploy.ros.wire import LATCHED
from lfa.protocol import clock
from lfa.protocol.geometry import STILL, Pose2D, Twist
from tests.deploy.robot.test_ros_scan import scan
from tests.rigs import ros_values
from tests.rigs.ros_peers import awaited, ros_pair

TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"


class Robot:
    """A ROS robot's node and the driver's base for it, over one router."""

    def __init__(self, ours: RosSpace, theirs: RosSpace, *, stamped: bool, at: Pose2D | None) -> None:
        self.node: NodeHandle = theirs.node("robot", "/r")
        self.odom = self.node.publisher("/r/odom", "nav_msgs/msg/Odometry")
        self.scans = self.node.publisher("/r/scan", "sensor_msgs/msg/LaserScan")
        self.amcl = self.node.publisher("/r/amcl_pose", "geometry_msgs/msg/PoseWithCovarianceStamped", LATCHED)
        self.tf = self.node.publisher("/tf", "tf2_msgs/msg/TFMessage")
        self.tf_static = self.node.publisher("/r/tf_static", "tf2_msgs/msg/TFMessage", LATCHED)
        self.commands = self.node.subscription("/r/cmd_vel", STAMPED if stamped else TWIST)
        self.warned: dict[str, str] = {}
        self.base = RosBase(
            ours.node("lfa_driver", "/r"), "/r", RosPreset(), stamped=stamped, start_map=at, warn=self.warned.setdefault
        )
        awaited(self.odom.heard, "odom is heard")

    def moves(self, x: float, late_s: float = 0.0) -> None:
        """Publish odometry at x [m], stamped `late_s` ago."""
        stamp_ns = time.time_ns() - round(1e9 * late_s)
        self.odom.publish(messages.odometry(stamp_ns, Pose2D(x, 0.0, 0.0), Twist(), 0.0, "odom", "base"))

    def reads(self, what: str = "pose_odom") -> Any:
        """Return the field `what` of the first reading that has it."""

        def found() -> Any:
            self.moves(1.0)
            reading = self.base.read(clock.now())
            return None if reading is None else getattr(reading, what)

        return awaited(found, what)


@pytest.fixture
def robot(request: pytest.FixtureRequest) -> Iterator[Robot]:
    options = {"stamped": True, "at": None, **getattr(request, "param", {})}
    with ros_pair() as (ours, theirs):
        yield Robot(ours, theirs, **options)


def test_while_odometry_is_missing_or_old_there_is_no_reading(robot: Robot) -> None:
    assert robot.base.read(clock.now()) is None
    assert robot.reads().x == 1.0
    assert robot.base.read(clock.now() + ODOM_S_MAX + 0.01) is None
    assert "no odometry for 0.2 s" in robot.warned["silent"]


@pytest.mark.parametrize("robot", [{"stamped": True}, {"stamped": False}], indirect=True)
def test_a_command_is_published_also_when_it_is_zero(robot: Robot) -> None:
    awaited(robot.base._cmd_vel.heard, "the robot listens")
    for twist in (Twist(0.5, 0.2), STILL):
        robot.base.drive(twist, clock.now())
    heard: list[Any] = []

    def both() -> bool:
        heard.extend(getattr(m, "twist", m) for m in robot.commands.take())
        return len(heard) == 2

    awaited(both, "both commands arrive")
    assert [(m.linear.x, m.angular.z) for m in heard] == [(0.5, 0.2), (0.0, 0.0)]


def test_map_to_odom_on_tf_places_the_robot_in_map(robot: Robot) -> None:
    awaited(robot.tf.heard, "tf is heard")

    def placed() -> Any:
        robot.tf.publish(messages.tf([messages.Transform(0, "map", "odom", Pose2D(10.0, 5.0, pi / 2))]))
        robot.moves(1.0)
        reading = robot.base.read(clock.now())
        return reading and reading.pose_map

    pose = awaited(placed, "a pose in map")
    assert (pose.x, pose.y) == pytest.approx((10.0, 6.0))


def test_a_latched_pose_of_the_localisation_places_it_too(robot: Robot) -> None:
    robot.reads()
    robot.amcl.publish(ros_values.pose_with_covariance(0, Pose2D(3.0, 4.0, 0.0), [0.0] * 36))
    pose = robot.reads("pose_map")
    assert (pose.x, pose.y) == pytest.approx((3.0, 4.0))


def _taken(robot: Robot, covariance: list[float]) -> None:
    assert robot.base._poses is not None
    fix = to_cdr(ros_values.pose_with_covariance(0, Pose2D(3.0, 4.0, 0.0), covariance))
    robot.base._poses._receive("", fix, b"")


UNSURE = [(0, 0.1), (7, 0.1), (35, 0.13), (0, nan), (35, inf), (7, -1.0)]


@pytest.mark.parametrize(("at", "variance"), UNSURE)
def test_a_pose_whose_covariance_is_too_great_or_none_is_no_pose(robot: Robot, at: int, variance: float) -> None:
    robot.reads()
    covariance = [0.0] * 36
    covariance[0], covariance[7], covariance[35] = 0.04, 0.01, 0.0625
    _taken(robot, covariance)
    reading = robot.base.read(clock.now() + 1.0)  # hands over what waits, however old the odometry
    assert robot.reads("pose_map").x == pytest.approx(3.0)
    covariance[at] = variance
    _taken(robot, covariance)
    for _ in range(3):
        robot.moves(0.0)
        clock.sleep(0.11)
        reading = robot.base.read(clock.now())
        assert reading is None or reading.pose_map is None
    assert "sigma" in robot.warned


def test_a_localisation_that_ended_gives_no_pose_after_a_metre(robot: Robot) -> None:
    """A topic's last value outlives its sender."""
    robot.reads()
    _taken(robot, [0.0] * 36)
    assert robot.reads("pose_map").x == pytest.approx(3.0)
    robot.base._odometer_m += 0.9
    assert robot.reads("pose_map").x == pytest.approx(3.0)
    robot.base._odometer_m += 0.2
    robot.reads()
    assert not robot.base._is_sure()
    assert "poses" in robot.warned
    _taken(robot, [0.0] * 36)
    assert robot.reads("pose_map").x == pytest.approx(3.0)


def test_odometry_that_moves_by_its_words_alone_is_none(robot: Robot) -> None:
    robot.reads()
    _, pose, _ = robot.base._odom
    odom = from_cdr(*reversed(messages.odometry(0, pose, Twist(0.3, 0.0), 0.0, "odom", "base")))
    begun = clock.now()
    for n in range(30):
        robot.base._take_odom(odom, begun + 0.02 * n)
    assert robot.base.read(begun + 0.6) is None
    assert "frozen" in robot.warned


@pytest.mark.parametrize("robot", [{"at": Pose2D(-1.2, 0.0, 0.0)}], indirect=True)
def test_without_localisation_it_begins_where_at_says(robot: Robot) -> None:
    assert robot.reads("pose_map").x == pytest.approx(-1.2)


def test_a_scan_waits_for_the_mount_of_its_scanner_and_says_so(robot: Robot) -> None:
    awaited(robot.scans.heard, "scan is heard")

    def unplaced() -> bool:
        robot.scans.publish(scan([1.0] * 4))
        robot.moves(1.0)
        robot.base.read(clock.now())
        return "mount" in robot.warned

    awaited(unplaced, "the missing mount is told")
    assert "no /tf_static leads from base" in robot.warned["mount"]
    robot.tf_static.publish(messages.tf([messages.Transform(0, "base", "laser", Pose2D(0.0, 0.0, pi / 2))]))

    def placed() -> Any:
        robot.scans.publish(scan([1.0] * 4, -pi))
        robot.moves(1.0)
        reading = robot.base.read(clock.now())
        return reading and reading.scan

    assert awaited(placed, "a scan").angle_min == pytest.approx(-pi / 2)


@pytest.mark.parametrize(
    ("x", "late_s", "kind_", "words"),
    [(1.0, 5.0, "clock", "differ from this clock by 5.0"), (nan, 0.0, "odom", "not finite"),
     (50.0, 0.0, "jump", "odom jumped by 49.00 m")],
)  # fmt: skip
def test_bad_odometry_is_one_warning(x: float, late_s: float, kind_: str, words: str, robot: Robot) -> None:
    robot.reads()

    def warned() -> bool:
        robot.moves(x, late_s)
        robot.base.read(clock.now())
        return kind_ in robot.warned

    awaited(warned, kind_)
    assert words in robot.warned[kind_]


def test_unusual_readings_of_a_scan_are_one_warning_each_and_the_scan_is_taken(robot: Robot) -> None:
    robot.tf_static.publish(messages.tf([messages.Transform(0, "base", "laser", Pose2D())]))

    def taken() -> Any:
        robot.scans.publish(scan([nan, 0.0, -inf, 2.0], pi, -pi / 2))
        robot.moves(1.0)
        reading = robot.base.read(clock.now())
        return reading and reading.scan

    made = awaited(taken, "a scan")
    assert made.ranges_m[:2] == (2.0, -inf), "in reverse"
    told = {kind: words for kind, words in robot.warned.items() if kind not in ("mount", "clock")}
    assert {"nan", "zero", "-inf", "clockwise"} == set(told)
    assert all("\n" not in words for words in told.values())


SHORT = st.floats(width=32)
SCANS = st.tuples(st.lists(SHORT, min_size=1, max_size=4), SHORT, SHORT, SHORT, SHORT)
NUMBERS = st.floats() | st.sampled_from((nan, inf, -inf, 1e308, -1e308, 0.0))


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_bytes_and_any_numbers_from_the_robot_are_a_plausible_reading_or_none(robot: Robot, data: Any) -> None:
    def number() -> float:
        return float(data.draw(NUMBERS))

    base, at = robot.base, Pose2D()
    odom = from_cdr(*reversed(messages.odometry(0, at, Twist(number(), number()), 0.0, "odom", "base")))
    fix = ros_values.pose_with_covariance(0, at, [0.0] * 36)
    tf = from_cdr(
        *reversed(messages.tf([messages.Transform(0, "map", "odom", at), messages.Transform(0, "base", "laser", at)]))
    )
    for place, turn in (
        *((one.pose.pose.position, one.pose.pose.orientation) for one in (odom, fix)),
        *((one.transform.translation, one.transform.rotation) for one in tf.transforms),
    ):
        place.x, place.y, turn.z = number(), number(), number()
    look = scan(*data.draw(SCANS))
    assert base._scans is not None
    assert base._poses is not None
    for subscription, message in ((base._odoms, odom), (base._poses, fix), (base._tf[0], tf), (base._scans, look)):
        whole, noise = to_cdr(message), data.draw(st.binary(max_size=80))
        subscription._receive("", data.draw(st.sampled_from((whole, noise, whole[: len(noise)]))), b"")
    reading = base.read(clock.now())
    if reading is not None:
        assert plausible(reading.pose_odom, reading.twist)
        assert isfinite(reading.odometer_m)
        assert reading.pose_map is None or isfinite(reading.pose_map.x)


def test_frames_are_composed_over_a_common_ancestor_and_circles_end() -> None:
    tree = FrameTree()
    links = [("base_footprint", "base_link", Pose2D(0.0, 0.0, 0.0)), ("base_link", "scan", Pose2D(-0.1, 0.0, pi / 2)),
             ("base_link", "imu", Pose2D(0.1, 0.2, 0.0)), ("a", "b", Pose2D()), ("b", "a", Pose2D())]  # fmt: skip
    told = messages.tf([messages.Transform(0, *link) for link in links])
    tree.update(from_cdr(told.payload, told.type), 0.0)
    assert tree.between("base_footprint", "scan") == Pose2D(-0.1, 0.0, pi / 2)
    found = tree.between("imu", "/scan")
    assert found is not None
    assert (found.x, found.y) == pytest.approx((-0.2, -0.2))
    assert tree.between("a", "scan") is None
