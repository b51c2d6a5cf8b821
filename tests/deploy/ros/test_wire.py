"""The wire format against bytes of genuine nodes (golden.json), and against any bytes at all."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfa.deploy.ros import wire
from lfa.deploy.ros.types import HASHES, type_hash
from lfa.deploy.ros.wire import Qos, RosEndpoint, RosNode
from lfa.protocol.errors import Refused

GOLDEN: dict[str, Any] = json.loads((Path(__file__).parent / "golden.json").read_text())
"""Recorded from genuine nodes: rclpy 9.1.2 over rmw_zenoh_cpp 0.6.7."""
QOS_TEXTS = {
    "::,10:,:,:,,": wire.DEFAULT,
    "2::,5:,:,:,,": wire.SENSOR_DATA,
    ":1:,1:,:,:,,": wire.LATCHED,
    ":1:,1000:,:10,0:,,": wire.ROSOUT,
    "::,1000:,:,:,,": Qos(depth=1000),
    "::,:,:,:,,": Qos(depth=42),
}
NAMES = st.from_regex(r"(/[a-z_][a-z0-9_]{0,8}){1,3}", fullmatch=True)


@pytest.mark.parametrize("token", GOLDEN["tokens"])
def test_a_genuine_token_is_read_and_written_byte_for_byte(token: str) -> None:
    entity = wire.read_token(token)
    assert entity is not None
    assert entity.token == token
    assert wire.gid(token).hex() == GOLDEN["gids"][token]


@pytest.mark.parametrize("text", QOS_TEXTS)
def test_the_qos_text_of_genuine_nodes_is_read_and_written(text: str) -> None:
    assert wire.read_qos(text) == QOS_TEXTS[text]
    assert QOS_TEXTS[text].text == text


@pytest.mark.parametrize("sample", [*GOLDEN["samples"], *GOLDEN["queries"], *GOLDEN["replies"]])
def test_a_genuine_attachment_is_read_and_written_byte_for_byte(sample: dict[str, Any]) -> None:
    genuine = bytes.fromhex(sample["attachment"])
    read = wire.read_attachment(genuine)
    assert read is not None
    assert wire.attachment(read.number, read.time_ns, read.gid) == genuine


@pytest.mark.parametrize("sample", [*GOLDEN["samples"], *GOLDEN["queries"]])
def test_a_genuine_sample_is_on_the_key_and_under_the_gid_of_its_endpoint(sample: dict[str, Any]) -> None:
    found = [
        entity
        for entity in map(wire.read_token, GOLDEN["tokens"])
        if isinstance(entity, RosEndpoint) and entity.key == sample["key"]
        if entity.gid.hex() == sample["attachment"][34:]
    ]
    assert len(found) == 1


@pytest.mark.parametrize("token", GOLDEN["tokens"])
def test_the_pinned_hash_is_the_one_that_genuine_nodes_write(token: str) -> None:
    entity = wire.read_token(token)
    if isinstance(entity, RosEndpoint) and entity.type in HASHES:
        assert type_hash(entity.type) == entity.hash


def test_humble_writes_a_word_in_place_of_the_hash() -> None:
    assert wire.data_key(
        0, "/map", "nav_msgs/msg/OccupancyGrid", type_hash("nav_msgs/msg/OccupancyGrid", "humble")
    ) == ("0/map/nav_msgs::msg::dds_::OccupancyGrid_/TypeHashNotSupported")


def test_a_buffer_endpoint_of_a_newer_distribution_is_read_without_its_last_part() -> None:
    plain = next(token for token in GOLDEN["tokens"] if "/MP/" in token)
    assert wire.read_token(f"{plain}/backends:cpu:;") == wire.read_token(plain)


@given(NAMES, NAMES, st.integers(0, 232), st.integers(0, 10**6), st.sampled_from(("MP", "MS", "SS", "SC")))
def test_what_is_written_is_read_back(space: str, topic: str, domain: int, number: int, kind: Any) -> None:
    node = RosNode(domain, "abc123", 0, space, "node")
    one = RosEndpoint(node, number, kind, topic, "nav_msgs/msg/Path", type_hash("nav_msgs/msg/Path"), wire.LATCHED)
    assert wire.read_token(one.token) == one
    assert wire.read_token(node.token) == node


@given(st.integers(-(2**63), 2**63 - 1), st.integers(-(2**63), 2**63 - 1), st.binary(min_size=16, max_size=16))
def test_an_attachment_has_33_bytes_whatever_it_says(number: int, time_ns: int, gid: bytes) -> None:
    built = wire.attachment(number, time_ns, gid)
    assert len(built) == 33
    assert wire.read_attachment(built) == wire.Attached(number, time_ns, gid)


@given(st.one_of(st.binary(max_size=15), st.binary(min_size=17, max_size=40)))
def test_no_attachment_is_built_around_a_gid_of_another_length(gid: bytes) -> None:
    with pytest.raises(AssertionError):
        wire.attachment(1, 0, gid)


@given(st.binary(max_size=60))
def test_any_bytes_as_attachment_are_read_or_refused(data: bytes) -> None:
    read = wire.read_attachment(data)
    assert (read is not None) == (len(data) == 33 and data[16] == 16)


@given(st.lists(st.text(max_size=6), max_size=16).map("/".join), st.sampled_from(GOLDEN["tokens"]), st.data())
def test_any_key_as_token_is_read_or_refused(noise: str, genuine: str, data: st.DataObject) -> None:
    parts = genuine.split("/")
    parts[data.draw(st.integers(0, len(parts) - 1))] = data.draw(st.text(max_size=12))
    for key in (noise, f"{wire.TOKENS}/{noise}", "/".join(parts)):
        entity = wire.read_token(key)
        assert entity is None or isinstance(entity, RosNode | RosEndpoint)


@pytest.mark.parametrize("name", ["odom", "/", "/a//b", "/1a", "/a b", "/*", "/a/**", "/$x", ""])
def test_a_name_that_ros_does_not_know_is_refused(name: str) -> None:
    with pytest.raises(Refused, match="full ROS name"):
        wire.check_name(name, "--namespace")


def test_the_attachment_is_little_endian() -> None:
    assert wire.attachment(1, 2, bytes(16)) == struct.pack("<qqB", 1, 2, 16) + bytes(16)
