"""`lfa bag`: write a run as a rosbag2 folder (MCAP) that `ros2 bag play`, Foxglove, PlotJuggler and rerun open.

Same mapping as the live bridge. Times are the run's own, from 0.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import typer
from msgspec import Struct
from rosbags.interfaces import Qos as BagQos
from rosbags.interfaces import QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from lfa.deploy.recording import mcap_channels
from lfa.deploy.recording.mcap_reader import look_into, recorded
from lfa.deploy.ros.cdr import NS
from lfa.deploy.ros.mapping import FleetMapping, RosMessage
from lfa.deploy.ros.topics import SOURCES, RosTopic, fleet_topics, robot_topics
from lfa.deploy.ros.types import to_cdr, typestore
from lfa.deploy.ros.wire import Qos
from lfa.deploy.terminal_text import print_visible
from lfa.protocol.errors import Refused
from lfa.protocol.messages.codec import Message
from lfa.protocol.topics import TOPIC

FOLDER = "rosbag2"
FORMAT: Literal[9] = 9
_INFINITE = QosTime(9223372036, 854775807)
_TOPICS = frozenset(source.split("/")[1] for source in SOURCES)


class BagFacts(Struct, frozen=True):
    """Size of a written bag."""

    folder: str
    messages: int
    topics: int
    duration_s: float


def command(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    out: Annotated[Path | None, typer.Option(help=f"Folder to create; default RUN/{FOLDER}.")] = None,
    tf_per_robot: Annotated[
        bool, typer.Option("--tf-per-robot", help="Topics /robotN/tf with plain frames, not /tf with robotN/ frames.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print folder and size as JSON.")] = False,
) -> int:
    """Write a run as a rosbag2 folder."""
    look_into(run)
    facts = write(run, out or run / FOLDER, tf_per_robot=tf_per_robot)
    if as_json:
        print_visible(json.dumps(msgspec.to_builtins(facts)))
    else:
        print_visible(f"{facts.folder}: {facts.messages} messages on {facts.topics} topics, {facts.duration_s:.1f} s")
    return 0


def write(run: Path, out: Path, *, tf_per_robot: bool = False) -> BagFacts:
    """Write the run in `run` as a bag in the new folder `out`; nothing is left of it when that fails.

    Raises Refused when `out` exists or cannot be made, and for a recording of another program.
    """
    if out.exists():
        raise Refused(f"{out}: exists already: give a new folder with --out")
    unfinished = out.with_name(f".{out.name}.part")  # holds a folder of the final name, which names the file in it
    shutil.rmtree(unfinished, ignore_errors=True)
    try:
        bag = _Bag(unfinished / out.name, tf_per_robot=tf_per_robot)
        try:
            for sent in mapped(run, tf_per_robot=tf_per_robot):
                bag.write(sent)
        finally:
            bag.close()
        (unfinished / out.name).rename(out)
    except OSError as error:
        raise Refused(f"{out}: cannot be made ({error.strerror}), give a place to write to") from None
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return BagFacts(str(out), bag.messages, bag.topics, bag.duration_s)


def mapped(run: Path, *, tf_per_robot: bool = False) -> Iterator[RosMessage]:
    """Yield the ROS messages of a run in the order of its recording."""
    mapping = FleetMapping(tf_per_robot=tf_per_robot)
    for owner, t, message in messages(run):
        stamp_ns = round(t * NS)
        yield from mapping.update(stamp_ns, owner, message)
        yield from mapping.tick(stamp_ns)


def messages(run: Path) -> Iterator[tuple[str, float, Message]]:
    """Yield owner, time [s] and message of what was recorded on the mapping's topics. Raises Refused."""
    for channel, t, body in recorded(run, _TOPICS):
        _, owner, topic, *_ = channel.split("/")
        try:
            yield owner, t, mcap_channels.restore(body, TOPIC[topic].type)
        except msgspec.DecodeError as error:
            raise Refused(f"{run}: recorded by another version of lfa, {channel}: {error}") from None


class _Bag:
    """Bag that is being written; a topic is added with its first message."""

    def __init__(self, folder: Path, *, tf_per_robot: bool) -> None:
        self._writer = Writer(folder, version=FORMAT, storage_plugin=StoragePlugin.MCAP)
        self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._writer.open()
        self._tf_per_robot = tf_per_robot
        self._table: dict[str, RosTopic] = {
            row.name: row for row in fleet_topics(tf_per_robot=tf_per_robot, sim_time=False)
        }
        self._connections: dict[str, Any] = {}
        self._first_ns: int | None = None
        self._last_ns = 0
        self.messages = 0

    @property
    def topics(self) -> int:
        return len(self._connections)

    @property
    def duration_s(self) -> float:
        return 0.0 if self._first_ns is None else (self._last_ns - self._first_ns) / NS

    def write(self, sent: RosMessage) -> None:
        connection = self._connections.get(sent.topic) or self._add(sent.topic)
        self._writer.write(connection, sent.stamp_ns, to_cdr(sent.message))
        self._first_ns = sent.stamp_ns if self._first_ns is None else self._first_ns
        self._last_ns = max(self._last_ns, sent.stamp_ns)
        self.messages += 1

    def close(self) -> None:
        self._writer.close()

    def _add(self, topic: str) -> Any:
        if topic not in self._table:
            robot = int(topic.split("/")[1].removeprefix("robot"))
            self._table |= {row.name: row for row in robot_topics(robot, tf_per_robot=self._tf_per_robot)}
        row = self._table[topic]
        connection = self._writer.add_connection(
            topic, row.type, typestore=typestore(), offered_qos_profiles=[bag_qos(row.qos)]
        )
        self._connections[topic] = connection
        return connection


def bag_qos(qos: Qos) -> BagQos:
    """Return the QoS as a bag stores it, so that `ros2 bag play` offers the same."""
    return BagQos(
        history=QosHistory.KEEP_LAST,
        depth=qos.depth,
        reliability=QosReliability.RELIABLE if qos.reliable else QosReliability.BEST_EFFORT,
        durability=QosDurability.TRANSIENT_LOCAL if qos.latched else QosDurability.VOLATILE,
        deadline=_INFINITE,
        lifespan=_INFINITE if qos.lifespan_s is None else QosTime(qos.lifespan_s, 0),
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=_INFINITE,
        avoid_ros_namespace_conventions=False,
    )
