"""`lfa run` in one terminal and `lfa ros --serve` in another: a ROS user's SDK lists, echoes and orders."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from lfa.deploy.ros import messages
from lfa.deploy.ros.topics import fleet_topics, robot_topics
from lfa.deploy.ros.types import kind, type_hash
from lfa.deploy.ros.wire import HASHLESS, LATCHED, Distro
from lfa.protocol.geometry import Pose2D
from lfa.protocol.transport.zenoh_ros import ros_session
from tests.rigs.foreign_peers import answer, start
from tests.rigs.lfa_runs import LFA, eventually, lfa, running
from tests.rigs.ros_peers import awaited, free_endpoint, ros_client
from tests.rigs.secured_fleet import FLEET, attacked

pytestmark = pytest.mark.processes
ECHOED = ("/robot1/odom", "/robot1/scan", "/tf", "/tf_static", "/lfa/leader", "/robot1/cmd_vel", "/diagnostics")


@contextmanager
def bridge(endpoint: str, *options: str) -> Iterator[subprocess.Popen[str]]:
    """Run `lfa ros` until the end of the block; it must say that it is ready."""
    words = [*LFA, "ros", "--ros", endpoint, "--json", *options]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        line = process.stderr.readline()
        assert "is on ROS domain 0" in line, line + process.stderr.read()
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def test_a_ros_users_sdk_lists_echoes_and_hands_over_and_the_robots_obey(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    table = {row.name: row for row in (*fleet_topics(tf_per_robot=False, sim_time=False), *robot_topics(1, tf_per_robot=False))}  # fmt: skip  # noqa: E501
    wanted = [f"{topic}={table[topic].type}={type_hash(table[topic].type)}" for topic in ECHOED]
    with running(tmp_path / "run", "paper_path1", "--robots", "3") as run:
        run.wait_for("leader_command")
        with bridge(endpoint, "--serve", "--fleet", f"paper_path1-{run.launcher.pid}") as bridged:
            user = start("sdk", "sdk_user.py", endpoint.rpartition(":")[2], "6", *wanted, home=tmp_path)
            told = json.loads(answer(user))
            assert {topic: [row.type] for topic, row in table.items()}.items() <= told["topics"].items()
            assert {"/robot2/odom", "/robot3/odom"} <= set(told["topics"])
            live = set(ECHOED) - {"/tf_static", "/lfa/leader"}  # latched before this SDK came, which asks for none
            assert live <= set(told["heard"]), told["heard"]
            transforms = told["last"]["/tf"]  # a message tells of the robots with news: whichever came last
            assert any(f"robot{n}/odom" in transforms for n in (1, 2, 3)), transforms
            assert "qos='2::,5:" in told["scan"][0], "best effort, depth 5"
            assert told["called"][0], told["called"]
            assert re.fullmatch(r"robot [23] leads", told["called"][1])  # a loaded machine may change it before
            eventually(lambda: any(e.get("by") == "operator" for e in run.events()), "the formation was not ordered")
            eventually(lambda: any(e.get("change") == "handed_over" for e in run.events()), "nobody handed over")
            bridged.send_signal(signal.SIGINT)
            out, _ = bridged.communicate(timeout=30.0)
            facts = json.loads(out)
            assert (facts["undecodable"], facts["fleet_dropped"]) == (0, 0)
            assert bridged.returncode == 0


@pytest.fixture(scope="module")
def exploring(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Name of a fleet whose leader explores."""
    with running(tmp_path_factory.mktemp("exploring") / "run", "explore", "--robots", "2") as run:
        run.wait_for("leader_command")
        yield f"explore-{run.launcher.pid}"


def test_a_ros_users_sdk_echoes_the_map_of_a_leader_that_explores(exploring: str, tmp_path: Path) -> None:
    endpoint, of_type = free_endpoint(), "nav_msgs/msg/OccupancyGrid"
    with bridge(endpoint, "--serve", "--fleet", exploring):
        user = start("sdk", "sdk_user.py", endpoint.rpartition(":")[2], "8", f"/map={of_type}={type_hash(of_type)}", home=tmp_path)  # fmt: skip  # noqa: E501
        told = json.loads(answer(user))
    assert told["heard"].get("/map", 0) > 0, told
    assert "frame_id='map'" in told["last"]["/map"]


def test_nodes_of_humble_hear_a_bridge_of_their_distribution_and_newer_ones_are_named_in_one_line(
    exploring: str, tmp_path: Path
) -> None:
    endpoint, of_type = free_endpoint(), "tf2_msgs/msg/TFMessage"
    with bridge(endpoint, "--serve", "--fleet", exploring, "--distro", "humble") as bridged:
        user = start("sdk", "sdk_user.py", endpoint.rpartition(":")[2], "4", f"/tf={of_type}={HASHLESS}", home=tmp_path)
        told = json.loads(answer(user))
        assert told["heard"].get("/tf", 0) > 0, told
        assert "robot1/base_link" in told["last"]["/tf"]
        with ros_client(endpoint, "jazzy") as newer:
            newer.node("talker").publisher("/chatter", "std_msgs/msg/String")
            assert bridged.stderr is not None
            assert (
                bridged.stderr.readline()
                == "lfa: /talker is of another distribution than --distro humble: it hears nothing\n"
            )


@pytest.mark.parametrize(
    ("present", "options", "said"),
    [
        ("lfa_bridge", (), "another bridge is on domain 0 (/lfa_bridge): stop it, or say --domain"),
        ("humble", (), "--distro jazzy: /talker speaks another key format and would hear nothing: say --distro humble"),
        ("jazzy", ("--distro", "humble"), "--distro humble: /talker speaks another key format"),
    ],
)
def test_what_is_there_already_and_would_hear_nothing_is_refused_in_one_line(
    present: str, options: tuple[str, ...], said: str, exploring: str
) -> None:
    endpoint = free_endpoint()
    distro: Distro = "humble" if present == "humble" else "jazzy"
    name = present if present == "lfa_bridge" else "talker"
    with closing(ros_session(endpoint, serve=True)), ros_client(endpoint, distro) as there:
        there.node(name).publisher("/chatter", "std_msgs/msg/String")
        done = lfa("ros", "--ros", endpoint, "--fleet", exploring, *options)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert said in line


def test_the_bridge_of_a_secured_fleet_shows_and_commands_it_with_the_operators_keys(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with attacked() as fleet:
        words = ("--serve", "--fleet", FLEET, "--connect", fleet.unix, "--keys", str(fleet.home))
        with bridge(endpoint, *words), ros_client(endpoint) as space:
            node = space.node("user")
            odom = node.subscription("/robot1/odom", "nav_msgs/msg/Odometry")
            awaited(odom.take, "the secured fleet's odometry")
            leader = node.subscription("/lfa/leader", "std_msgs/msg/Int32", LATCHED)
            awaited(lambda: any(number.data for number in leader.take()), "a leader")
            for service, of_type, data, told in (
                ("/lfa/handover", "Trigger", 0, "robot 2 leads"),
                ("/lfa/pause", "SetBool", True, "order 1 carried out by robot 2"),
                ("/lfa/pause", "SetBool", False, "order 2 carried out by robot 2"),
                ("/lfa/stop", "Trigger", 0, "stopped: robot1, robot2, robot3 (epoch 1)"),
                ("/lfa/resume", "Trigger", 0, "may go: robot1, robot2, robot3 (epoch 2)"),
            ):
                client = node.client(service, f"std_srvs/srv/{of_type}")
                answered = client.call(kind(f"std_srvs/msg/{of_type}_Request")(data), timeout_s=10.0)
                assert answered is not None, service
                assert answered.success, answered.message
                assert answered.message.startswith(told)
            goals = node.publisher("/goal_pose", "geometry_msgs/msg/PoseStamped")
            awaited(goals.heard, "the bridge listens to goals")
            goals.publish(messages.pose_stamped(0, Pose2D(20.0, 5.0, 0.0)))

            def driven_to() -> bool:
                fleet.team.listen()
                return any(event.kind == "order" and event.data["version"] == 3 for event in fleet.team.heard.events)

            awaited(driven_to, "the team takes the goal")


def test_without_a_ros_router_the_bridge_says_in_one_line_what_to_do(tmp_path: Path) -> None:
    done = lfa("ros", "--ros", free_endpoint(), "--fleet", "nobody", "--connect", f"unixsock-stream/{tmp_path}/r.sock")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "no ROS router answers" in line
    assert "--serve" in line
