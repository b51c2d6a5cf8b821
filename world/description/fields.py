"""What the types of a scenario say of its keys: a document becomes one, or a line says which value is not of its type.

A key is said as a person would: `world.obstacles[2].radius_m`, `restart.robot2`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import msgspec

from lfa.protocol.errors import Refused
from lfa.world.description.scenario import Scenario

SHOWN_MAX = 60
_PARTS = re.compile(r"\w+|\[\d*\]")


def converted(document: dict[str, Any]) -> Scenario:
    """The scenario that `document` says. Raises Refused: key, value, what would be right."""
    try:
        return msgspec.convert(document, Scenario)
    except msgspec.ValidationError as error:
        text, _, place = str(error).partition(" - at `$")
        key = _named(document, place.removesuffix("`").removeprefix(".").replace("[...]", "[]"))
        missing = re.fullmatch(r"Object missing required field `(\w+)`", text)
        if missing:
            name = ".".join(part for part in (key, missing[1]) if part)
            raise Refused(f"{name} is missing: must be given") from None
        right = text.replace("`", "").replace("Expected ", "").replace(", got ", ", not ").replace(" | null", "")
        words = list(_words_in(_type_of(key))) if text.startswith("Invalid enum value") else []
        right = f"one of {', '.join(words)}" if words else right
        raise Refused(f"{key} = {value_at(document, key)}: must be {right}") from None


def value_at(document: Any, key: str) -> str:
    """The value of a key, as far as the document has it, cut to what fits in a line."""
    for part in _PARTS.findall(key):
        document = _inside(document, part)
    text = str(document)
    return text if len(text) <= SHOWN_MAX else f"{text[: SHOWN_MAX - 3]}..."


def structs_in(type_: Any) -> Iterator[type[msgspec.Struct]]:
    """The Structs that an annotation speaks of: `Lidar`, `tuple[Obstacle, ...]`."""
    if isinstance(type_, type) and issubclass(type_, msgspec.Struct):
        yield type_
    for argument in getattr(type_, "__args__", ()):
        yield from structs_in(argument)


def _inside(value: Any, part: str) -> Any:
    """What `value` holds at a part of a key; itself when it holds nothing."""
    index = part.strip("[]")
    if isinstance(value, dict):
        return value.get(index, "...")
    if isinstance(value, list) and index.isdecimal() and int(index) < len(value):
        return value[int(index)]
    return value


def _named(document: Any, key: str) -> str:
    """`key` with the name of the entry that msgspec leaves out, writing `restart[]`: the first of a wrong type."""
    table_key, entry, _ = key.partition("[]")
    if not entry:
        return key
    table: Any = document
    for part in _PARTS.findall(table_key):
        table = _inside(table, part)
    _, type_ = _type_of(table_key).__args__
    return f"{table_key}.{next(name for name, value in table.items() if not _fits(value, type_))}"


def _fits(value: Any, type_: Any) -> bool:
    try:
        msgspec.convert(value, type_)
    except msgspec.ValidationError:
        return False
    return True


def _type_of(key: str) -> Any:
    """What stands in the types at a key: that of the field, or of the table or list that the key goes on into."""
    type_: Any = Scenario
    for part in re.findall(r"[^\W\d]\w*", key):
        struct = next(structs_in(type_), None)
        if struct is None:
            break
        type_ = {field.encode_name: field.type for field in msgspec.structs.fields(struct)}[part]
    return type_


def _words_in(type_: Any) -> Iterator[str]:
    """The words that an annotation admits: of `Literal["left", "right"] | None` these two."""
    if isinstance(type_, str):
        yield type_
    for argument in getattr(type_, "__args__", ()):
        yield from _words_in(argument)
