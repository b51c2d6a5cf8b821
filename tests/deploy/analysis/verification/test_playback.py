"""A recording back onto a bus: what was recorded as JSON becomes the message that travelled."""

from __future__ import annotations

from math import inf, nan

import pytest

from deploy.run.channels import encode, restore
from protocol import messages as m
from protocol.geometry import Pose2D
from protocol.mission import Leading, Mission

HEADER = m.Header("robot1", 7, 3, 1.25)
TERM = m.Term(3, 1, 7)
ME = m.Member(1, 7)
CONFIG = m.Config(m.Version(TERM, 2), (ME,), ME, m.Electorate((ME,)), (ME, m.Member(2, 9)))

SAID = (
    m.LaserScan(HEADER, 0.0, 0.1, 0.05, 8.0, (1.5, inf, -inf, 3.0)),
    m.LeaseNote(HEADER, m.Propose(TERM, CONFIG, 4, ME, (TERM,), 0.5)),
    m.LeaseNote(HEADER, m.Hello(None)),
    m.LeaseNote(HEADER, m.Nack(TERM, TERM, None, 0.25, CONFIG)),
    m.MissionNote(HEADER, Mission(leading=Leading(route_m=((1.0, 2.0),)), can_lead=(1, 2))),
    m.Tracking(HEADER, 1, 1.2, 1.0, 0.1, 0.2, Pose2D(1.0, 2.0, 3.0), inf, True, "follow"),
    m.Event(HEADER, "decision", None, {"class": "obstacle", "free_m": 1.5}),
    m.Truth(HEADER, 1.0, (m.TrueRobot(1, 0.0, 1.0, 2.0, 3.0, 4.0),), ()),
)


@pytest.mark.parametrize("message", SAID, ids=lambda message: type(message).__name__)
def test_what_was_recorded_is_the_message_again(message: m.Message) -> None:
    assert restore(encode(message), type(message)) == message


def test_a_bad_reading_stays_one() -> None:
    scan = restore(encode(m.LaserScan(HEADER, 0.0, 0.1, 0.05, 8.0, (nan,))), m.LaserScan)
    assert scan.ranges_m[0] != scan.ranges_m[0]
