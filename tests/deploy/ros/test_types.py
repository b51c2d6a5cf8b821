"""CDR and type hashes against bytes of genuine nodes, and against any bytes at all."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfa.deploy.ros import types
from lfa.deploy.ros.cdr import CDR_LITTLE_ENDIAN
from lfa.deploy.ros.types import BadRosMessage, from_cdr, kind, request_type, response_type, to_cdr
from lfa.deploy.ros.wire import ros_type
from tests.deploy.ros.test_wire import GOLDEN

SAMPLES = [(ros_type(one["key"].split("/")[-2]), bytes.fromhex(one["payload"])) for one in GOLDEN["samples"]]


@pytest.mark.parametrize("name", [name for name in types.HASHES if "/msg/" in name])
def test_the_pinned_hash_is_that_of_the_definition(name: str) -> None:
    assert types.typestore().hash_rihs01(name) == types.type_hash(name)


@pytest.mark.parametrize(("name", "payload"), [one for one in SAMPLES if one[0] in types.HASHES])
def test_a_genuine_message_is_read_and_written_byte_for_byte_but_for_its_padding(name: str, payload: bytes) -> None:
    written = to_cdr(from_cdr(payload, name))
    again = to_cdr(from_cdr(written, name))
    assert written == again
    assert len(written) == len(payload)
    wrong = [n for n, (ours, theirs) in enumerate(zip(written, payload, strict=True)) if ours != theirs]
    assert all(written[n] == 0 for n in wrong), "padding is zero here, and garbage of genuine nodes"
    assert from_cdr(written, name) is not None


@pytest.mark.parametrize(
    ("message", "hexed"),
    [
        (lambda: kind("std_msgs/msg/String")("hi"), "00010000 03000000 686900"),
        (lambda: kind("std_srvs/msg/Trigger_Request")(0), "00010000 00"),
        (lambda: kind("std_srvs/msg/Trigger_Response")(True, "hi"), "00010000 01 000000 03000000 686900"),
        (lambda: kind("rosgraph_msgs/msg/Clock")(kind("builtin_interfaces/msg/Time")(1, 2)),
         "00010000 01000000 02000000"),
    ],
)  # fmt: skip
def test_small_messages_are_the_bytes_of_genuine_nodes(message: Any, hexed: str) -> None:
    assert to_cdr(message()).hex() == hexed.replace(" ", "")


def test_a_genuine_query_and_reply_are_read() -> None:
    query, reply = GOLDEN["queries"][0], GOLDEN["replies"][0]
    assert from_cdr(bytes.fromhex(query["payload"]), request_type("std_srvs/srv/Trigger")) is not None
    answer = from_cdr(bytes.fromhex(reply["payload"]), response_type("std_srvs/srv/Trigger"))
    assert (answer.success, answer.message) == (True, "reset by /robot3")


@settings(max_examples=400)
@given(st.sampled_from([name for name in types.HASHES if "/msg/" in name]), st.binary(max_size=200))
def test_any_bytes_are_a_message_or_refused(name: str, data: bytes) -> None:
    for payload in (data, CDR_LITTLE_ENDIAN + data):
        try:
            from_cdr(payload, name)
        except BadRosMessage:
            continue


@settings(max_examples=200)
@given(st.sampled_from([one for one in SAMPLES if one[0] in types.HASHES]), st.data())
def test_a_genuine_message_with_changed_or_missing_bytes_is_read_or_refused(sample: Any, data: st.DataObject) -> None:
    name, payload = sample
    at = data.draw(st.integers(0, len(payload) - 1))
    for bad in (payload[:at], payload[:at] + data.draw(st.binary(min_size=4, max_size=4)) + payload[at + 4 :]):
        try:
            from_cdr(bad, name)
        except BadRosMessage:
            continue


def test_a_payload_without_bound_is_refused() -> None:
    with pytest.raises(BadRosMessage, match="more than"):
        from_cdr(bytes(types.PAYLOAD_BYTES_MAX + 1), "std_msgs/msg/String")
