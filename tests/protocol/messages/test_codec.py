"""The codec: what is said arrives as it was said; what is no message of ours is refused and crashes nothing."""

import math
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from lfa.protocol.geometry import Pose2D, Twist
from lfa.protocol.messages.codec import DATA_DEPTH_MAX, BadMessage, Message, decode, encode
from lfa.protocol.messages.consensus import (
    Config,
    GatewayStamp,
    Grant,
    Grantee,
    Hello,
    LeaseNote,
    Member,
    Nack,
    Prepare,
    Promise,
    Propose,
    Role,
    Term,
    Version,
)
from lfa.protocol.messages.header import MESSAGE_BYTES_MAX, Header
from lfa.protocol.messages.robot import CmdVel, GroundProfile, LaserScan, Localization, Sensors
from lfa.protocol.messages.team import (
    Delay,
    Event,
    FormationNote,
    MissionNote,
    OperatorNote,
    PlanNote,
    PoseStamped,
    Slot,
    TableRow,
)
from lfa.protocol.mission import Mission
from lfa.protocol.topics import TOPICS

HEADER = Header("robot1", 5, 7, 12.5)
TERM = Term(3, 1, 5)
GATEWAY = GatewayStamp(9, 12.48)
CONFIG = Config(Version(TERM, 1), (Member(1, 5), Member(0, 2)), Member(0, 2), None, (Member(1, 5),))

SAMPLES: list[Message] = [
    PoseStamped(HEADER, 1.0, 2.0, 0.0, 0.5, Twist(0.5, 0.1), 12.0, Role.LEADER, TERM),
    CmdVel(HEADER, Twist(0.5, -0.2), TERM, 1, True, GATEWAY),
    Sensors(HEADER, Pose2D(1.0, 2.0, 3.0), Twist(0.1, 0.2), 4.0, GATEWAY, TERM),
    LeaseNote(HEADER, Prepare(TERM, CONFIG.version)),
    LeaseNote(HEADER, Promise(TERM, CONFIG, Grantee(TERM, Member(1, 5)), False)),
    LeaseNote(HEADER, Propose(TERM, CONFIG, 4, Member(1, 5), (TERM,), 1.5)),
    LeaseNote(HEADER, Hello(None)),
    TableRow(HEADER, 1.0, 2.0, 0.0, 0.5, 3.0, Role.FOLLOWER, (Delay(2, 0.001),)),
    PlanNote(HEADER, ((0.0, 1.0), (2.0, 1.5)), 0.1, (-1.0, -2.0), 2, bytes([0, 1, 2, 1])),
    Event(HEADER, "decision", None, {"action": "left", "free_m": 0.5}),
]


@pytest.mark.parametrize("message", SAMPLES, ids=lambda message: type(message).__name__)
def test_what_is_said_arrives_as_it_was_said(message: Message) -> None:
    assert decode(encode(message), type(message)) == message


def test_heights_without_a_reading_arrive_as_such_and_the_lines_places_are_finite() -> None:
    heights = ((0.0, math.nan, -math.inf), (0.01, -0.02, 0.0))
    ground = GroundProfile(HEADER, 0.1, 0.05, (0.12, -0.12), heights)
    read = decode(encode(ground), GroundProfile)
    assert str(read) == str(ground)  # nan differs from itself, its name does not
    with pytest.raises(BadMessage, match="float"):
        decode(encode(GroundProfile(HEADER, 0.1, 0.05, (math.nan, 0.0), heights)), GroundProfile)


def test_out_of_range_beams_arrive_as_infinities_and_bad_ones_as_nan() -> None:
    scan = LaserScan(HEADER, 0.0, 0.1, 0.05, 8.0, (math.inf, -math.inf, math.nan, 1.5))
    ranges = decode(encode(scan), LaserScan).ranges_m  # type: ignore[union-attr]
    assert ranges[:2] == (math.inf, -math.inf)
    assert math.isnan(ranges[2])
    assert ranges[3] == 1.5


@given(st.binary(max_size=400))
def test_random_bytes_are_refused_on_every_topic(payload: bytes) -> None:
    for topic in TOPICS:
        with pytest.raises(BadMessage):
            decode(payload, topic.type)


@given(st.sampled_from(SAMPLES), st.data())
def test_truncated_messages_are_refused(message: Message, data: st.DataObject) -> None:
    payload = encode(message)
    cut = data.draw(st.integers(0, len(payload) - 1))
    with pytest.raises(BadMessage):
        decode(payload[:cut], type(message))


@given(st.sampled_from(SAMPLES), st.data())
def test_one_flipped_byte_is_refused_or_decodes_to_a_finite_message(message: Message, data: st.DataObject) -> None:
    payload = bytearray(encode(message))
    payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        got = decode(bytes(payload), type(message))
    except BadMessage:
        return
    assert math.isfinite(got.header.stamp)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_numbers_that_a_core_would_compute_with_are_finite(bad: float) -> None:
    wrong: list[Message] = [
        PoseStamped(HEADER, bad, 2.0, 0.0, 0.5, Twist(), 12.0, Role.LEADER, TERM),
        CmdVel(HEADER, Twist(bad, 0.0), TERM, 1, True, GATEWAY),
        CmdVel(HEADER, Twist(), TERM, 1, True, GatewayStamp(1, bad)),
        Localization(Header("robot1", 1, 1, bad), Pose2D()),
        LeaseNote(HEADER, Grant(TERM, 1, CONFIG.version, bad)),
        FormationNote(HEADER, TERM, 1, (Slot(2, bad, 3.0),)),
        PlanNote(HEADER, ((0.0, bad),), 0.1, (0.0, 0.0), 1, b"1"),
    ]
    for message in wrong:
        with pytest.raises(BadMessage):
            decode(encode(message), type(message))


def test_a_config_whose_chain_has_no_leader_is_refused() -> None:
    """Whoever adopts a config compares the head of its chain with itself."""
    nobody = structs.replace(CONFIG, chain=())
    for body in (
        Propose(TERM, nobody, 4, Member(1, 5)),
        Promise(TERM, nobody, None, False),
        Nack(TERM, TERM, None, 0.0, nobody),
    ):
        with pytest.raises(BadMessage, match="length >= 1"):
            decode(encode(LeaseNote(HEADER, body)), LeaseNote)


@pytest.mark.parametrize("n", [-1, 2**53 + 1, 2**63, 2**64 - 1])
def test_a_count_that_none_could_add_to_and_say_is_refused(n: int) -> None:
    wrong: list[Message] = [
        LeaseNote(HEADER, Prepare(Term(n, 1, 5), CONFIG.version)),
        LeaseNote(HEADER, Propose(TERM, CONFIG, n, Member(1, 5))),
        LeaseNote(Header("robot1", n, 7, 12.5), Hello(None)),
        FormationNote(HEADER, TERM, n, ()),
        CmdVel(HEADER, Twist(), Term(3, n, 5), 1, True, GATEWAY),
    ]
    for message in wrong:
        with pytest.raises(BadMessage, match="int"):
            decode(encode(message), type(message))


@pytest.mark.parametrize("step_m", [0.0, -0.02, 1e-300, math.nan])
def test_the_floor_is_looked_at_in_steps_that_come_to_an_end(step_m: float) -> None:
    with pytest.raises(BadMessage):
        decode(encode(GroundProfile(HEADER, 0.1, step_m, (0.0,), ((-0.2, 0.0),))), GroundProfile)


@pytest.mark.parametrize("offsets_m", [(), (0.0,), (0.0, 0.1, 0.2)])
def test_each_line_of_the_floor_has_its_place(offsets_m: tuple[float, ...]) -> None:
    with pytest.raises(BadMessage, match="fit together"):
        decode(encode(GroundProfile(HEADER, 0.1, 0.05, offsets_m, ((0.0,), (0.0,)))), GroundProfile)


@pytest.mark.parametrize("far_m", [1e300, -1e10])
def test_a_place_so_far_off_that_sums_of_it_have_no_end_is_refused(far_m: float) -> None:
    with pytest.raises(BadMessage):
        decode(encode(Localization(HEADER, Pose2D(far_m, 0.0, 0.0))), Localization)


def test_a_stamp_may_count_from_1970() -> None:
    fix = Localization(Header("robot1", 5, 7, 1.8e9), Pose2D())
    assert decode(encode(fix), Localization) == fix


@pytest.mark.parametrize("columns", [0, -2, 3])
def test_a_tile_of_a_map_is_a_whole_rectangle(columns: int) -> None:
    with pytest.raises(BadMessage):
        decode(encode(PlanNote(HEADER, (), 0.1, (0.0, 0.0), columns, bytes(4))), PlanNote)


@pytest.mark.parametrize("control_hz", [0.0, -20.0, 1e-300, 9.9, 50.1, math.inf, math.nan])
def test_a_mission_whose_control_rate_gives_no_durations_is_refused(control_hz: float) -> None:
    """Witness and driver compute deadman and bond from it, and check nothing else of a mission."""
    with pytest.raises(BadMessage):
        decode(encode(MissionNote(HEADER, Mission(control_hz=control_hz))), MissionNote)


def _nested(depth: int) -> Any:
    return [_nested(depth - 1)] if depth else 1.0


@pytest.mark.parametrize(
    "value",
    [_nested(DATA_DEPTH_MAX), _nested(700), msgspec.msgpack.Ext(7, b"x"), {1: 2}, {"a": {None: 1}}, b"bytes"],
    ids=["deep", "as deep as a decoder goes", "an extension", "a number as key", "none as key", "bytes"],
)
def test_what_no_json_says_or_no_reader_descends_into_is_no_event_and_no_command(value: Any) -> None:
    for message in (Event(HEADER, "x", None, {"a": value}), OperatorNote(HEADER, "x", {"a": value})):
        with pytest.raises(BadMessage):
            decode(encode(message), type(message))


def test_an_event_may_say_lists_of_lists() -> None:
    event = Event(HEADER, "x", None, {"a": _nested(DATA_DEPTH_MAX - 1)})
    assert decode(encode(event), Event) == event


def test_a_message_of_another_topic_is_refused() -> None:
    with pytest.raises(BadMessage, match="CmdVel belongs"):
        decode(encode(SAMPLES[0]), CmdVel)


def test_an_oversized_message_is_refused_unread() -> None:
    with pytest.raises(BadMessage, match="bytes"):
        decode(bytes(MESSAGE_BYTES_MAX + 1), LaserScan)
