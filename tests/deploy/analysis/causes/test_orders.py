"""`lfa why`: an operator's orders are roots, each once, however often they were repeated."""

from __future__ import annotations

from pathlib import Path

from lfa.deploy.analysis.causes import orders
from lfa.deploy.recording.recorder import Recorder
from lfa.protocol.messages.codec import Message
from lfa.protocol.messages.header import Header
from lfa.protocol.messages.stop import StopOrder, StopWord
from lfa.protocol.messages.team import OperatorNote


def header(seq: int) -> Header:
    return Header("operator", 1, seq, 0.0)


def test_orders_are_roots_each_once_and_simulated_faults_are_none(tmp_path: Path) -> None:
    said: list[tuple[str, Message]] = [
        ("operator", OperatorNote(header(1), "handover")),
        ("operator", OperatorNote(header(2), "weather", {"heal": True})),
        ("stop", StopOrder(header(1), StopWord(1, stand=True))),
        ("stop", StopOrder(header(2), StopWord(1, stand=True))),
        ("stop", StopOrder(header(3), None)),
        ("stop", StopOrder(header(4), StopWord(2, stand=False))),
    ]
    recorder = Recorder(tmp_path, {})
    for n, (topic, message) in enumerate(said):
        recorder.record(float(n), f"lfa/f/operator/{topic}", message)
    recorder.close()
    found = [(fact.at_s, fact.other, fact.evidence) for fact in orders.facts(tmp_path)]
    assert found == [
        (0.0, "handover", "operator 1 of operator"),
        (2.0, "stop", "stop 1 of operator"),
        (5.0, "resume", "stop 4 of operator"),
    ]
