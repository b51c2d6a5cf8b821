"""A recording back onto a bus: what was recorded as JSON becomes the message that travelled."""

from __future__ import annotations

from math import inf, nan

import pytest

from lfa.deploy.recording.mcap_channels import encode, restore
from lfa.protocol.geometry import Pose2D
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.consensus import Config, Electorate, Hello, LeaseNote, Member, Nack, Propose, Term, Version
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.messages.simulation import TrueRobot, Truth
from lfa.protocol.messages.team import Event, MissionNote, Tracking
from lfa.protocol.mission import Leading, Mission

HEADER = Header("robot1", 7, 3, 1.25)
TERM = Term(3, 1, 7)
ME = Member(1, 7)
CONFIG = Config(Version(TERM, 2), (ME,), ME, Electorate((ME,)), (ME, Member(2, 9)))

SAID = (
    LaserScan(HEADER, 0.0, 0.1, 0.05, 8.0, (1.5, inf, -inf, 3.0)),
    LeaseNote(HEADER, Propose(TERM, CONFIG, 4, ME, (TERM,), 0.5)),
    LeaseNote(HEADER, Hello(None)),
    LeaseNote(HEADER, Nack(TERM, TERM, None, 0.25, CONFIG)),
    MissionNote(HEADER, Mission(leading=Leading(route_m=((1.0, 2.0),)), can_lead=(1, 2))),
    Tracking(HEADER, 1, 1.2, 1.0, 0.1, 0.2, Pose2D(1.0, 2.0, 3.0), inf, True, "follow"),
    Event(HEADER, "decision", None, {"class": "obstacle", "free_m": 1.5}),
    Truth(HEADER, 1.0, (TrueRobot(1, 0.0, 1.0, 2.0, 3.0, 4.0),), ()),
)


@pytest.mark.parametrize("message", SAID, ids=lambda message: type(message).__name__)
def test_what_was_recorded_is_the_message_again(message: Message) -> None:
    assert restore(encode(message), type(message)) == message


def test_a_bad_reading_stays_one() -> None:
    scan = restore(encode(LaserScan(HEADER, 0.0, 0.1, 0.05, 8.0, (nan,))), LaserScan)
    assert scan.ranges_m[0] != scan.ranges_m[0]
