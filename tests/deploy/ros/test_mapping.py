"""The mapping from a fleet's messages to ROS messages."""

from __future__ import annotations

from math import atan2, inf, isinf
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfa.deploy.ros import explored
from lfa.deploy.ros.mapping import NS, FleetMapping, RosMessage
from lfa.deploy.ros.topics import fleet_topics, robot_topics, sources_heard
from lfa.deploy.ros.types import from_cdr
from lfa.protocol.geometry import STILL, Pose2D, Twist, compose, wrap
from lfa.protocol.messages.consensus import Config, GatewayStamp, LeaseNote, Member, Propose, Role, Term, Version
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import CmdVel, LaserScan, Sensors
from lfa.protocol.messages.team import Event, Level, PlanNote, PoseStamped, Status, Tracking

T = 5 * NS
TERM = Term(7, 1, 1)
ORIGIN = Pose2D()
STAMP = GatewayStamp(1, 0.0)
ANGLES = st.floats(-3.1, 3.1)
PLACES = st.builds(Pose2D, st.floats(-50, 50), st.floats(-50, 50), ANGLES)


def header(sender: str = "robot3") -> Header:
    return Header(sender, 1, 1, 5.0)


def sensors(at: Pose2D = ORIGIN, twist: Twist = STILL, term: Term = TERM, latched: bool = False) -> Sensors:
    return Sensors(header("world"), at, twist, 1.0, STAMP, term, latched)


def pose(at: Pose2D, robot: int = 3, role: Role = Role.FOLLOWER, term: Term = TERM) -> PoseStamped:
    return PoseStamped(header(f"robot{robot}"), at.x, at.y, 0.0, at.theta, Twist(), 1.0, role, term)


def command(term: Term = TERM, as_leader: bool = False) -> CmdVel:
    return CmdVel(header(), Twist(0.5, 0.1), term, 1, as_leader, STAMP)


def on(topic: str, sent: list[RosMessage]) -> Any:
    """Return the only message on `topic` of `sent`, as a subscriber would decode it."""
    (one,) = [one for one in sent if one.topic == topic]
    return from_cdr(one.message.payload, one.message.type)


def placed(transform: Any) -> Pose2D:
    move, turn = transform.transform.translation, transform.transform.rotation
    return Pose2D(move.x, move.y, 2.0 * atan2(turn.z, turn.w))


def test_odometry_has_the_robots_frames_its_pose_and_its_twist() -> None:
    odom = on("/robot3/odom", FleetMapping().update(T, "robot3", sensors(Pose2D(1.0, 2.0, 0.0), Twist(0.5, 0.1))))
    assert (odom.header.frame_id, odom.child_frame_id, odom.header.stamp.sec) == ("robot3/odom", "robot3/base_link", 5)
    assert (odom.pose.pose.position.x, odom.pose.pose.position.y) == (1.0, 2.0)
    assert (odom.twist.twist.linear.x, odom.twist.twist.angular.z) == (0.5, 0.1)
    assert odom.pose.covariance[0] > 0.0


def test_a_scan_keeps_what_is_out_of_range() -> None:
    scan = LaserScan(header("world"), -1.0, 0.5, 0.1, 10.0, (inf, 2.0, -inf, float("nan")))
    sent = on("/robot3/scan", FleetMapping().update(T, "robot3", scan))
    assert sent.header.frame_id == "robot3/base_scan"
    assert isinf(sent.ranges[0])
    assert (sent.ranges[1], sent.ranges[2], sent.angle_max) == (2.0, -inf, 0.5)
    assert np.isnan(sent.ranges[3])


@given(PLACES, PLACES, st.floats(-1.0, 1.0), st.floats(-2.0, 2.0), st.integers(0, NS // 10))
def test_the_transforms_lead_from_map_to_where_the_robot_says_that_it_is(
    in_map: Pose2D, in_odom: Pose2D, v: float, omega: float, later_ns: int
) -> None:
    mapping = FleetMapping()
    mapping.update(T, "robot3", sensors(in_odom, Twist(v, omega)))
    mapping.update(T, "robot3", pose(in_map))
    odom_base, map_odom = on("/tf", mapping.tick(T + later_ns)).transforms
    frames = [(one.header.frame_id, one.child_frame_id) for one in (map_odom, odom_base)]
    assert frames == [("map", "robot3/odom"), ("robot3/odom", "robot3/base_link")]
    base = compose(placed(map_odom), placed(odom_base))
    assert (base.x, base.y) == pytest.approx((in_map.x, in_map.y), abs=1e-6)
    assert wrap(base.theta - in_map.theta) == pytest.approx(0.0, abs=1e-6)


def test_one_message_carries_the_transforms_of_all_robots_fifty_times_a_second() -> None:
    mapping = FleetMapping()
    counts = []
    for step in range(100):
        at = T + step * NS // 100
        for robot in (1, 2, 3):
            mapping.update(at, f"robot{robot}", sensors())
        counts += [len(on("/tf", [one]).transforms) for one in mapping.tick(at) if one.topic == "/tf"]
    assert counts == [3] * 50


def test_with_sim_time_the_clock_ticks_fifty_times_a_second_in_the_worlds_time() -> None:
    mapping = FleetMapping(sim_time=True)
    sent = [one for step in range(200) for one in mapping.tick(T + step * NS // 200) if one.topic == "/clock"]
    assert len(sent) == 50
    told = on("/clock", sent[-1:]).clock
    assert told.sec * NS + told.nanosec == sent[-1].stamp_ns >= T + NS - NS // 40
    assert all(one.topic != "/clock" for one in FleetMapping().tick(T))


@given(st.lists(st.integers(0, 19), min_size=1, max_size=5), st.integers(0, 3))
def test_no_robots_transform_waits_longer_than_two_periods_whatever_the_phases(phases_ms: list[int], dead: int) -> None:
    """Robots at 50 Hz, each at its own phase; one of them falls silent after a second."""
    mapping = FleetMapping()
    heard_ms: dict[str, int] = {}
    for ms in range(2000):
        at = T + ms * NS // 1000
        for n, phase in enumerate(phases_ms):
            if ms % 20 == phase and (ms < 1000 or n != dead):
                mapping.update(at, f"robot{n + 1}", sensors())
        for one in mapping.tick(at):
            if one.topic == "/tf":
                heard_ms |= {told.child_frame_id: ms for told in on("/tf", [one]).transforms}
        living = [f"robot{n + 1}/base_link" for n in range(len(phases_ms)) if ms < 1000 or n != dead]
        assert ms < 60 or all(ms - heard_ms[frame] <= 40 for frame in living)


def test_transforms_of_robots_that_report_together_go_out_at_once_and_together() -> None:
    mapping = FleetMapping()
    for robot in (1, 2, 3):
        mapping.update(T, f"robot{robot}", sensors())
    assert len(on("/tf", mapping.tick(T)).transforms) == 3
    for burst in range(1, 5):
        at = T + burst * NS // 50
        for robot in (1, 2):
            mapping.update(at, f"robot{robot}", sensors())
        assert all(one.topic != "/tf" for one in mapping.tick(at)), "robot 3 comes next"
        mapping.update(at, "robot3", sensors())
        assert len(on("/tf", mapping.tick(at)).transforms) == 3


@pytest.mark.parametrize("robot", [2**31 - 1, 2**31, 10**18 - 1])
def test_a_robot_of_any_id_that_a_name_can_carry_is_shown(robot: int) -> None:
    mapping = FleetMapping()
    mapping.update(T, f"robot{robot}", pose(ORIGIN, role=Role.LEADER))
    ticked = mapping.tick(T)
    (arrow, _) = on("/lfa/formation", ticked).markers
    assert arrow.id == on("/lfa/leader", ticked).data == robot % 2**31
    assert mapping.leader == robot


def test_the_bridge_hears_only_what_the_topics_that_are_heard_are_made_of() -> None:
    def heard(*topics: str) -> frozenset[str]:
        return sources_heard((1, 2), lambda topic: topic in topics, tf_per_robot=False)

    assert heard() == frozenset()
    assert heard("/robot2/odom") == {"*/sensors"}
    assert heard("/tf") == {"*/sensors"}
    assert heard("/robot1/scan") == {"*/scan"}
    assert heard("/robot1/cmd_vel") == {"*/cmd_vel", "*/sensors"}, "the gateway's state tells what it obeys"
    assert heard("/lfa/formation") == {"*/tracking"}
    assert heard("/robot3/odom") == frozenset(), "no such robot"
    assert sources_heard((1,), lambda topic: topic == "/robot1/tf", tf_per_robot=True) == {"*/sensors"}


def test_a_pose_is_compared_with_the_odometry_of_its_own_time() -> None:
    """The bridge reads poses ten times a second: the newest odometry is of later."""
    mapping = FleetMapping()
    for n in range(6):
        mapping.update(T + n * NS // 50, "robot3", sensors(Pose2D(0.01 * n * n, 0.0, 0.0)))
    mapping.update(T + NS // 50, "robot3", pose(Pose2D(5.01, 0.0, 0.0)))
    _, map_odom = on("/tf", mapping.tick(T + NS // 10)).transforms
    assert placed(map_odom).x == pytest.approx(5.0)


def test_with_tf_per_robot_the_frames_are_plain_and_the_topics_are_the_robots() -> None:
    mapping = FleetMapping(tf_per_robot=True)
    sent = mapping.update(T, "robot3", sensors())
    assert on("/robot3/odom", sent).child_frame_id == "base_link"
    ticked = mapping.tick(T)
    assert on("/robot3/tf", ticked).transforms[0].child_frame_id == "base_link"
    assert {one.child_frame_id for one in on("/robot3/tf_static", ticked).transforms} == {"map", "base_scan"}


def test_a_command_that_the_gateway_refuses_is_not_shown() -> None:
    mapping = FleetMapping()
    mapping.update(T, "robot3", sensors())
    assert on("/robot3/cmd_vel", mapping.update(T, "robot3", command())).twist.linear.x == 0.5
    assert mapping.update(T, "robot3", command(Term(6, 1, 1))) == []
    mapping.update(T, "robot3", sensors(latched=True))
    assert mapping.update(T, "robot3", command(as_leader=True)) == []
    assert mapping.update(T, "robot3", command(Term(8, 2, 1), as_leader=True)) != []


def test_only_what_somebody_hears_is_built_but_for_latched_topics() -> None:
    mapping = FleetMapping(sim_time=False, heard=lambda topic: False)
    sent = []
    for message in (sensors(), pose(Pose2D(1, 1, 0), role=Role.LEADER), command(), event(), status()):
        sent += [*mapping.update(T, "robot3", message), *mapping.tick(T)]
    latched = {row.name for row in (*fleet_topics(tf_per_robot=False, sim_time=False), *robot_topics(3, tf_per_robot=False)) if row.qos.latched}  # fmt: skip  # noqa: E501
    assert {one.topic for one in sent} <= latched
    assert "/lfa/leader" in {one.topic for one in sent}


def event(kind: str = "contact") -> Event:
    return Event(header(), kind, None, {"robot": 3, "with": "obstacle 1"})


def status(level: Level = Level.WARN) -> Status:
    return Status(header(), level, "waiting for robot2", Role.WAITING, TERM, {"loop_lag_ms": 0.5})


def test_the_leader_is_the_claim_of_the_highest_term_and_nobody_when_claims_are_old() -> None:
    mapping = FleetMapping()
    mapping.update(T, "robot1", pose(Pose2D(), 1, Role.LEADER, Term(6, 1, 1)))
    mapping.update(T, "robot2", pose(Pose2D(), 2, Role.LEADER, Term(7, 2, 1)))
    assert on("/lfa/leader", mapping.tick(T)).data == 2
    assert on("/lfa/leader", mapping.tick(T + 3 * NS)).data == 0


def test_the_chain_is_told_when_it_changes() -> None:
    mapping = FleetMapping()

    def proposal(n: int, *chain: int) -> LeaseNote:
        config = Config(Version(TERM, n), (), None, None, tuple(Member(robot, 1) for robot in chain))
        return LeaseNote(header(), Propose(TERM, config, 1, Member(1, 1)))

    assert on("/lfa/chain", mapping.update(T, "robot1", proposal(1, 1, 2, 3))).data == "1 2 3"
    assert mapping.update(T, "robot1", proposal(1, 1, 2, 3)) == []
    assert on("/lfa/chain", mapping.update(T, "robot1", proposal(2, 2, 3))).data == "2 3"
    assert mapping.update(T, "robot1", proposal(1, 1, 2, 3)) == [], "an older config is not the chain"


def test_diagnostics_and_log_carry_level_text_and_counters() -> None:
    mapping = FleetMapping()
    mapping.update(T, "robot1", pose(Pose2D(), 1, Role.LEADER))
    mapping.update(T, "robot3", status())
    (one,) = on("/diagnostics", mapping.tick(T)).status
    assert (one.level, one.name, one.message) == (1, "lfa: robot3", "waiting for robot2")
    assert {"role": "waiting", "term": "7", "leader": "1", "loop_lag_ms": "0.5"}.items() <= {
        v.key: v.value for v in one.values
    }.items()
    log = on("/rosout", mapping.update(T, "robot3", event()))
    assert (log.level, log.name) == (30, "robot3")
    assert "obstacle 1" in log.msg


def test_the_markers_show_slot_and_predecessor_of_a_follower() -> None:
    mapping = FleetMapping()
    mapping.update(T, "robot2", pose(Pose2D(2.0, 0.0, 0.0), 2, Role.LEADER))
    mapping.update(T, "robot3", pose(Pose2D(1.0, 0.0, 0.0)))
    slot = Pose2D(0.9, 0.1, 0.0)
    mapping.update(T, "robot3", Tracking(header(), 2, 1.0, 3.14, 0.0, 0.0, slot, 0.14, False, "following"))
    marks = {(one.ns, one.id): one for one in on("/lfa/formation", mapping.tick(T)).markers}
    assert marks["slots", 3].pose.position.x == 0.9
    assert [(point.x, point.y) for point in marks["predecessors", 3].points] == [(1.0, 0.0), (2.0, 0.0)]
    assert marks["names", 2].text == "2 leader"
    assert ("slots", 2) not in marks


def tile(x: float, y: float, cells: bytes, cell_m: float = 0.5) -> PlanNote:
    return PlanNote(header(), ((0.0, 0.0), (1.0, 1.0)), cell_m, (x, y), 2, cells)


def test_the_map_is_assembled_from_the_leaders_tiles() -> None:
    mapping = FleetMapping()
    mapping.update(T, "robot3", tile(0.0, 0.0, bytes([0, 1, 2, 1])))
    mapping.update(T, "robot3", tile(1.0, 1.0, bytes([2, 2, 2, 2])))
    grid = on("/map", mapping.tick(T))
    assert (grid.info.width, grid.info.height, grid.info.resolution) == (4, 4, 0.5)
    assert grid.data.reshape(4, 4).tolist() == [
        [-1, 0, -1, -1],
        [100, 0, -1, -1],
        [-1, -1, 100, 100],
        [-1, -1, 100, 100],
    ]
    assert [one for one in mapping.tick(T + 2 * NS) if one.topic == "/map"] == [], "nothing has changed"


@given(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9), st.floats(-1e9, 1e9))
def test_a_tile_anywhere_leaves_a_map_of_bounded_size(x: float, y: float, cell_m: float) -> None:
    map_ = explored.ExploredMap()
    map_.update(tile(0.0, 0.0, bytes(4), cell_m))
    map_.update(tile(x, y, bytes(4), cell_m))
    found = map_.grid()
    assert found is None or len(found.cells) <= explored.CELLS_MAX
