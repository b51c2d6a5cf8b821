"""What a version of the messages adds is at their end and has a default, so that neighbours read each other (E35)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, get_args

import msgspec
import pytest
from msgspec import structs

from lfa.protocol.messages import codec, consensus
from lfa.protocol.messages.consensus import Hello, LeaseNote, Member, Prepare, Propose, Term, Version
from lfa.protocol.messages.header import UNSAID_WIRE, WIRE_ADDS, WIRE_VERSION, Header
from lfa.protocol.messages.team import MissionNote
from lfa.protocol.mission import Leading, Mission

BEFORE = json.loads((Path(__file__).parent / "wire_5.json").read_text())
"""Fields of each message, and of each struct in one, in the version before."""
ADDED = WIRE_ADDS[WIRE_VERSION]
HEADER, TERM = Header("robot1", 7, 3, 1.5), Term(9, 1, 7)
CONFIG = consensus.Config(Version(TERM), (Member(1, 7),), None, None, (Member(1, 7),))
BODIES = (
    Prepare(TERM, Version(TERM), (Member(2, 1),), 77, WIRE_VERSION),
    Propose(TERM, CONFIG, 4, Member(1, 7), (), 0.5, 77, WIRE_VERSION),
    Hello(Version(TERM), 77, WIRE_VERSION),
)


def _structs() -> dict[str, type]:
    """Every struct that a message is or holds, but those of a mission: it is agreed on field by field."""
    found: dict[str, type] = {}

    def visit(kind: Any) -> None:
        if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
            if kind.__name__ in found or kind.__module__ == Mission.__module__:
                return
            found[kind.__name__] = kind
            for field in structs.fields(kind):
                visit(field.type)
        for part in get_args(kind):
            visit(part)

    visit(codec.Message)
    return found


def test_e35_a_message_has_changed_only_by_what_its_version_adds_at_its_end_with_a_default() -> None:
    """Else: WIRE_VERSION + 1, what it adds in WIRE_ADDS, and a new table of the version before."""
    assert {name: [f.name for f in structs.fields(kind)] for name, kind in _structs().items()} == {
        name: [*fields, *(added.split(".")[1] for added in ADDED if added.split(".")[0] == name)]
        for name, fields in BEFORE.items()
    }
    added = [tuple(name.split(".")) for name in ADDED]
    assert not any(
        field.required
        for name, fields in _structs().items()
        for field in structs.fields(fields)
        if (name, field.name) in added
    )


@pytest.mark.parametrize("body", BODIES, ids=lambda body: type(body).__name__)
def test_e35_the_version_before_reads_todays_message_without_what_is_added(body: msgspec.Struct) -> None:
    kind = type(body)
    kept = BEFORE[kind.__name__]
    older = msgspec.defstruct(
        kind.__name__,
        [(f.name, f.type, *(() if f.required else (f.default,))) for f in structs.fields(kind) if f.name in kept],
        array_like=True,
        tag=kind.__struct_config__.tag,  # type: ignore[attr-defined]
    )
    read = msgspec.msgpack.decode(msgspec.msgpack.encode(body), type=older)
    assert [getattr(read, name) for name in kept] == [getattr(body, name) for name in kept]


@pytest.mark.parametrize("body", BODIES, ids=lambda body: type(body).__name__)
def test_e35_a_message_of_the_version_before_says_by_its_silence_which_it_is(body: Any) -> None:
    tag, header, values = msgspec.msgpack.decode(codec.encode(LeaseNote(HEADER, body)))
    kept = BEFORE[type(body).__name__]
    note = codec.decode(msgspec.msgpack.encode([tag, header, values[: len(kept) + 1]]), LeaseNote)
    assert isinstance(note, LeaseNote)
    assert note.body == structs.replace(body, wire=UNSAID_WIRE)


def test_e35_the_version_before_reads_the_mission_of_robots_that_are_polygons_without_their_footprint() -> None:
    corners = ((0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.1, -0.1))
    mission = structs.replace(Mission(leading=Leading(route_m=((1.0, 0.0),))), footprint_m=corners)
    sent = codec.encode(MissionNote.of(HEADER, mission))
    tag, header, plain, told = msgspec.msgpack.decode(sent)
    assert "footprint_m" not in plain
    assert len(told) == len(corners)
    older = codec.decode(msgspec.msgpack.encode([tag, header, plain]), MissionNote)
    newer = codec.decode(sent, MissionNote)
    assert isinstance(older, MissionNote) and isinstance(newer, MissionNote)
    assert older.whole == structs.replace(mission, footprint_m=msgspec.UNSET)
    assert newer.whole == mission
