"""Recorded JSON has null for None alone, whatever numbers a message holds beside it."""

from __future__ import annotations

from math import inf, nan
from typing import NoReturn

import msgspec
import pytest
from msgspec import Struct, structs

from lfa.deploy.recording import mcap_channels
from lfa.protocol.messages.consensus import NO_TERM, Config, LeaseNote, Member, Propose, Term, Version
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import ObstacleNote

CHAIN = tuple(Member(n, 1) for n in range(1, 5))
NOTE = LeaseNote(
    Header("robot1", 1, 1, 2.5), Propose(Term(7), Config(Version(NO_TERM, 0), CHAIN, None, None, CHAIN), 3, CHAIN[0])
)
HANDED_OVER = structs.replace(NOTE, body=structs.replace(NOTE.body, nonce=1.5))


def test_a_round_of_the_lease_is_converted_without_a_call_for_each_member(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_value: object) -> NoReturn:
        raise AssertionError("converted value by value")

    monkeypatch.setattr(mcap_channels, "plain", fail)
    for note in (NOTE, HANDED_OVER):
        assert b"null" in mcap_channels.encode(note)


@pytest.mark.parametrize(
    "message",
    [
        NOTE,
        HANDED_OVER,
        structs.replace(NOTE, header=structs.replace(NOTE.header, stamp=nan)),
        structs.replace(NOTE, body=structs.replace(NOTE.body, nonce=inf)),
        ObstacleNote(NOTE.header, "moving", 1.0, 2.0, 0.1, (nan, 0.0)),
        ObstacleNote(NOTE.header, "moving", -inf, 2.0, 0.1, (0.0, 0.0)),
    ],
)
def test_a_number_that_is_not_finite_is_its_name_also_beside_a_none(message: Struct) -> None:
    assert mcap_channels.encode(message) == msgspec.json.encode(mcap_channels.plain(message))
