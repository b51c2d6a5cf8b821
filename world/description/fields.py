"""Conversion of a TOML document to a Scenario by its types, with one-line errors for a value of the wrong type.

Keys are written as in `--set`: `world.obstacles[2].radius_m`, `restart.robot2`.
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
    """Convert `document` to a scenario. Raises Refused with the key, the value and the valid range."""
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
    """Return the value of a key as text, as far as the document has it, cut to `SHOWN_MAX` characters."""
    for part in _PARTS.findall(key):
        document = _inside(document, part)
    text = str(document)
    return text if len(text) <= SHOWN_MAX else f"{text[: SHOWN_MAX - 3]}..."


def structs_in(type_: Any) -> Iterator[type[msgspec.Struct]]:
    """Yield the Struct types inside an annotation such as `Lidar` or `tuple[Obstacle, ...]`."""
    if isinstance(type_, type) and issubclass(type_, msgspec.Struct):
        yield type_
    for argument in getattr(type_, "__args__", ()):
        yield from structs_in(argument)


def _inside(value: Any, part: str) -> Any:
    """Return the member of `value` at a part of a key; `value` itself if it has no such member."""
    index = part.strip("[]")
    if isinstance(value, dict):
        return value.get(index, "...")
    if isinstance(value, list) and index.isdecimal() and int(index) < len(value):
        return value[int(index)]
    return value


def _named(document: Any, key: str) -> str:
    """Return `key` with the entry's name for msgspec's `restart[]`: that of the first entry of a wrong type."""
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
    """Return the type at a key: that of the field, or of the table or list in which the rest of the key lies."""
    type_: Any = Scenario
    for part in re.findall(r"[^\W\d]\w*", key):
        struct = next(structs_in(type_), None)
        if struct is None:
            break
        type_ = {field.encode_name: field.type for field in msgspec.structs.fields(struct)}[part]
    return type_


def _words_in(type_: Any) -> Iterator[str]:
    """Yield the words that an annotation admits: for `Literal["left", "right"] | None` these two."""
    if isinstance(type_, str):
        yield type_
    for argument in getattr(type_, "__args__", ()):
        yield from _words_in(argument)
