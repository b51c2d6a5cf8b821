"""A run as a rosbag2 folder, read back by readers that nobody here wrote."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader

from lfa.deploy.ros import bag
from lfa.deploy.ros.topics import fleet_topics, robot_topics
from lfa.deploy.run import simulate
from lfa.protocol.errors import Refused
from lfa.world.description.load import draw, load
from tests.rigs.foreign_peers import answer, start

ROBOTS = (1, 2, 3)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scenario = load("straight")
    mission = msgspec.structs.replace(
        scenario.mission,
        robots=ROBOTS,
        leading=msgspec.structs.replace(scenario.mission.leading, route_m=((1.5, 0.0),)),
    )
    scenario = msgspec.structs.replace(scenario, mission=mission)
    return simulate.run(draw(scenario, 1), 1, tmp_path_factory.mktemp("run") / "run").folder


@pytest.fixture(scope="module")
def written(run: Path) -> Path:
    bag.write(run, run / bag.FOLDER)
    return run / bag.FOLDER


def test_every_topic_has_the_type_and_the_qos_of_the_table(written: Path) -> None:
    table = {row.name: row for row in fleet_topics(tf_per_robot=False, sim_time=False)}
    for robot in ROBOTS:
        table |= {row.name: row for row in robot_topics(robot, tf_per_robot=False)}
    with Reader(written) as reader:
        assert {"/tf", "/robot1/odom", "/robot3/scan", "/lfa/formation", "/lfa/leader"} <= set(reader.topics)
        for topic, info in reader.topics.items():
            assert info.msgtype == table[topic].type
            (qos,) = info.connections[0].ext.offered_qos_profiles  # type: ignore[union-attr]
            assert (qos.durability is QosDurability.TRANSIENT_LOCAL) == table[topic].qos.latched
            assert qos.depth == table[topic].qos.depth


def test_rosbags_decodes_every_message_at_its_time(written: Path) -> None:
    with AnyReader([written]) as reader:
        for connection, at_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if hasattr(message, "header") and connection.topic.endswith("/odom"):
                assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == at_ns
        assert reader.message_count > 1000


def test_foxgloves_reader_decodes_every_message_by_the_definitions_in_the_file(written: Path) -> None:
    (file,) = written.glob("*.mcap")
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        count = sum(message is not None for *_, message in reader.iter_decoded_messages())
    with AnyReader([written]) as again:
        assert count == again.message_count


@pytest.mark.processes
def test_foxgloves_own_reader_decodes_every_message(written: Path, tmp_path: Path) -> None:
    (file,) = written.glob("*.mcap")
    counts = json.loads(answer(start("foxglove", "foxglove_bag.js", str(file), home=tmp_path)))
    with AnyReader([written]) as reader:
        assert counts == {topic: info.msgcount for topic, info in reader.topics.items()}


@pytest.mark.processes
def test_reruns_importer_finds_no_fault_and_draws_transforms_and_poses(written: Path, tmp_path: Path) -> None:
    (file,) = written.glob("*.mcap")
    rerun, drawn = Path(sys.executable).with_name("rerun"), tmp_path / "bag.rrd"
    for words in (("check", str(file)), ("convert", str(file), "-o", str(drawn))):
        done = subprocess.run([str(rerun), "mcap", *words], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    told = subprocess.run([str(rerun), "rrd", "print", "-v", str(drawn)], capture_output=True, text=True, check=True)
    assert {"Transform3D", "InstancePoses3D"} <= set(re.findall(r"Transform3D|InstancePoses3D", told.stdout))


def test_the_odometry_of_the_bag_is_the_recorded_one(run: Path, written: Path) -> None:
    recorded = [m.pose_odom.x for owner, _, m in bag.messages(run) if owner == "robot2" and hasattr(m, "pose_odom")]
    with AnyReader([written]) as reader:
        of_robot = [one for one in reader.connections if one.topic == "/robot2/odom"]
        bagged = [reader.deserialize(raw, c.msgtype).pose.pose.position.x for c, _, raw in reader.messages(of_robot)]  # type: ignore[attr-defined]  # fmt: skip
    assert bagged == recorded


def test_a_folder_that_exists_is_refused_and_left_alone(run: Path, tmp_path: Path) -> None:
    with pytest.raises(Refused, match="exists already"):
        bag.write(run, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_what_fails_half_way_leaves_nothing(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> object:
        yield next(iter(real(run)))
        raise Refused("recorded by another version of lfa")

    real = bag.mapped
    monkeypatch.setattr(bag, "mapped", broken)
    with pytest.raises(Refused):
        bag.write(run, tmp_path / "bag")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Refused, match="no run folder"):
        bag.command(tmp_path)
