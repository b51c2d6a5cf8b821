"""Facts of missed events, and holes: what a log and a summary say after the recorder's link stood still."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path

import pytest
from msgspec import structs

from lfa.deploy.recording import event_log
from lfa.deploy.recording.holes import STATE_GAP_MAX, Holes
from lfa.deploy.recording.recorder import Hole, Recorder, Recording
from lfa.protocol.geometry import STILL, Pose2D
from lfa.protocol.messages.consensus import GatewayStamp, Role, Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import Sensors
from lfa.protocol.messages.team import Event, Level, Status

FIRST, SECOND = Term(7, 1, 1), Term(9, 2, 1)
TWO_HOLES = [Hole("robot2/pose", 260, 4.0, 5.25), Hole("a/event", 6, 4.0, 5.0)]


def _status(robot: int, role: Role, term: Term, chain: tuple[int, ...]) -> Status:
    counters = {"config_n": float(term.n), "config_seq": 0.0}
    return Status(Header(f"robot{robot}", 1, 1, 0.0), Level.OK, role.value, role, term, counters, chain)


def _sensors(term: Term) -> Sensors:
    return Sensors(Header("world", 1, 1, 0.0), Pose2D(), STILL, 0.0, GatewayStamp(1, 0.0), term)


def _said(tmp_path: Path, *, gateway: Term = SECOND) -> list[event_log.Line]:
    """The log of a run whose recorder heard the events of the first leader, and of the second only its state."""
    recorder = Recorder(tmp_path, {})
    begun = Header("robot1", 1, 1, 0.0)
    recorder.record(1.0, "lfa/x/robot1/event", Event(begun, "chain", FIRST, {"chain": [1, 2], "seq": 0}))
    recorder.record(1.0, "lfa/x/robot1/event", Event(begun, "role", FIRST, {"role": "leader"}))
    led = Event(Header("world", 1, 1, 0.0), "leader_command", FIRST, {"robot": 1})
    recorder.record(1.1, "lfa/x/world/event", led)
    for at in (1.5, 2.5):
        recorder.record(at, "lfa/x/robot1/sensors", _sensors(FIRST))
        recorder.record(at, "lfa/x/robot1/status", _status(1, Role.LEADER, FIRST, (1, 2)))
    for at in (9.0, 10.0):
        recorder.record(at, "lfa/x/robot2/sensors", _sensors(gateway))
        recorder.record(at, "lfa/x/robot2/status", _status(2, Role.LEADER, SECOND, (2,)))
    recorder.close()
    return event_log.lines(tmp_path)


def test_a_leader_whose_events_were_missed_is_in_the_log_once(tmp_path: Path) -> None:
    events = _said(tmp_path)
    assert [(reign.robot_id, reign.from_s) for reign in event_log.leader_terms(events)] == [(1, 1.1), (2, 9.0)]
    assert event_log.last_chain(events) == [2]
    assert [line["role"] for line in events if line["kind"] == "role"] == ["leader", "leader"]
    assert len([line for line in events if line.get("again")]) == 3


def test_a_leader_that_no_gateway_obeys_is_not_written_down_as_one(tmp_path: Path) -> None:
    events = _said(tmp_path, gateway=FIRST)
    assert [reign.robot_id for reign in event_log.leader_terms(events)] == [1]


def test_any_missed_event_is_a_hole_and_of_states_a_long_gap_only() -> None:
    holes = Holes()
    for at, seq in ((0.0, 1), (0.1, 2 + STATE_GAP_MAX), (0.2, 20)):
        holes.see(at, "lfa/x/robot2/pose", Header("robot2", 1, seq, 0.0))
    for at, seq in ((0.0, 4), (0.5, 6), (0.6, 5)):
        holes.see(at, "lfa/x/robot2/event", Header("robot2", 1, seq, 0.0))
    first = Hole("robot2/pose", 20 - 3 - STATE_GAP_MAX, 0.1, 0.2)
    assert holes.widest() == [first, Hole("robot2/event", 1, 0.0, 0.5)]
    assert holes.missing == first.missing + STATE_GAP_MAX + 1


def test_an_incarnation_counts_its_messages_anew() -> None:
    holes = Holes()
    for number, seq in ((1, 500), (2, 0), (2, 1)):
        holes.see(0.0, "lfa/x/robot2/event", Header("robot2", number, seq, 0.0))
    assert holes.missing == 0


def test_a_recording_with_holes_says_where_and_when() -> None:
    missing = "not recorded: 266 messages never arrived, between 4.0 and 5.2 s: robot2/pose 260, a/event 6"
    assert Recording(messages=1, files=1, bytes=1, missing=270, holes=TWO_HOLES).losses() == [missing]


def test_short_gaps_of_states_are_no_holes() -> None:
    assert Recording(messages=1, files=1, bytes=1, missing=4).losses() == []


@pytest.mark.parametrize("number", [inf, -inf, nan, -1.0])
def test_a_counter_that_is_no_number_of_a_config_ends_nobody(number: float, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, {})
    status = _status(1, Role.LEADER, FIRST, (1, 2))
    for name in status.counters:
        recorder.record(1.0, "lfa/x/robot1/status", structs.replace(status, counters={**status.counters, name: number}))
    recorder.close()
    assert all(line["kind"] != "chain" or line["seq"] == 0 for line in event_log.lines(tmp_path))
