"""The picture of a team, which `lfa web --live` draws from what any member may say."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import msgspec
import pytest

from lfa.deploy.view.picture.picture import Picture
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.robot import LaserScan
from lfa.protocol.messages.team import Event

HEADER = Header("robot1", 1, 1, 0.0)
STRANGE: tuple[Any, ...] = (inf, nan, 2**63, -1, "x", "", None, True, [], [[1]], {}, {"a": 1})
SAID = (
    ("chain", "chain"), ("chain", "seq"), ("lease", "change"), ("fault", "deed"), ("fault", "robot"),
    ("role", "role"), ("decision", "action"), ("obstacle", "x"), ("formation", "side"), ("died", "robot"),
)  # fmt: skip
"""Kinds of events, each with a field that a picture reads."""
GOOD = {"chain": [1, 2], "seq": 1, "robot": 1, "deed": "loss", "index": 0, "x": 1.0, "y": 1.0, "radius_m": 0.1}


@pytest.mark.parametrize(("kind", "field"), SAID)
def test_no_event_of_a_member_ends_a_picture(kind: str, field: str) -> None:
    picture = Picture((1, 2))
    for value in STRANGE:
        picture.see(1.0, "robot1", "event", Event(HEADER, kind, Term(1, 1, 1), {**GOOD, field: value}))
    assert msgspec.json.encode([picture.frame(), picture.news.since(0)])


def test_a_range_without_bounds_is_a_beam_without_a_range() -> None:
    picture = Picture((1, 2))
    picture.wanted_scans = {1}
    picture.see(1.0, "robot1", "scan", LaserScan(HEADER, 0.0, 0.1, 0.1, 8.0, (1.0, 1e308, inf, -inf, nan)))
    assert b"[100,0,0,0,0]" in msgspec.json.encode(picture.frame())
