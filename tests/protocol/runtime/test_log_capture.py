"""What a node says in its events stands in its log, and no reader of the log can hold it up."""

from __future__ import annotations

import os

from lfa.protocol.messages.codec import encode
from lfa.protocol.messages.consensus import Term
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.team import Event
from lfa.protocol.runtime.log_capture import line, tell

KEY = "lfa/fleet/robot2/event"
EVENT = Event(Header("robot2", 17, 1, 12.5), "role", Term(5, 2, 17), {"role": "leader", "chain": [2, 3], "at_m": 1 / 3})


def test_a_line_says_when_who_and_what() -> None:
    said = line(EVENT, 86_400_000 * 20_000 + 3_723_004)
    assert said == "01:02:03.004Z robot2 role role=leader chain=[2,3] at_m=0.3333 term=5"


def test_an_event_is_told_and_nothing_else_is() -> None:
    out, into = os.pipe()
    with os.fdopen(into, "w") as stream:
        tell(KEY, encode(EVENT), 0, stream)
        tell(KEY, b"no event", 0, stream)
    with os.fdopen(out) as told:
        assert told.read() == line(EVENT, 0) + "\n"


def test_a_reader_that_does_not_read_holds_nobody_up() -> None:
    out, into = os.pipe()
    with os.fdopen(into, "w") as stream:
        for _ in range(10_000):  # far more than a pipe takes: this would hang
            tell(KEY, encode(EVENT), 0, stream)
        os.close(out)
        tell(KEY, encode(EVENT), 0, stream)  # nor does one that has gone
    tell(KEY, encode(EVENT), 0, stream)
