"""Conversion of a TOML document to a Struct, with all of its mistakes and not only the first."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec
from msgspec import NODEFAULT, Struct
from msgspec.structs import FieldInfo, fields

S = TypeVar("S", bound=Struct)
SHOWN_MAX = 60


def read(document: dict[str, Any], struct: type[S], mistakes: list[str], where: str = "") -> S | None:
    """Return `document` as `struct`; None when a required key is missing or wrong.

    `mistakes` gets one line per mistake. A wrong value is replaced by its default, so that values that depend
    on it can still be checked.
    """
    known = {field.encode_name: field for field in fields(struct)}
    hints = get_type_hints(struct)
    for key in document.keys() - known.keys():
        close = get_close_matches(key, known, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"known are {', '.join(known)}"
        mistakes.append(f"{where}{key} = {_shown(document[key])}: no such key: {hint}")
    given: dict[str, Any] = {}
    complete = True
    for key, field in known.items():
        if key in document:
            value, right = _value(document[key], hints[field.name], mistakes, f"{where}{key}")
            if right:
                given[field.name] = value
                continue
        elif _must(field):
            mistakes.append(f"{where}{key} is missing: must be given")
        complete = complete and not _must(field)
    return struct(**given) if complete else None


def _value(value: Any, kind: Any, mistakes: list[str], where: str) -> tuple[Any, bool]:
    """Return the value as `kind`, and True if the conversion succeeded."""
    if _is_struct(kind) and isinstance(value, dict):
        made = read(value, kind, mistakes, f"{where}.")
        return made, made is not None
    if get_origin(kind) is dict and _is_struct(get_args(kind)[1]) and isinstance(value, dict):
        made_all = {key: _value(item, get_args(kind)[1], mistakes, f"{where}.{key}") for key, item in value.items()}
        return {key: item for key, (item, right) in made_all.items() if right}, True
    try:
        return msgspec.convert(value, kind), True
    except msgspec.ValidationError as error:
        mistakes.append(f"{where} = {_shown(value)}: must be {_right(kind, str(error))}")
        return None, False


def _right(kind: Any, error: str) -> str:
    """Return a text on the right value: the words of a choice, or the message of msgspec."""
    for choice in (kind, *get_args(kind)):
        if get_origin(choice) is Literal:
            return f"one of {', '.join(map(str, get_args(choice)))}"
    text = error.partition(" - at `$")[0].replace("`", "").replace("Expected ", "").removeprefix("Object ")
    return text.replace(", got ", ", not ").replace(" | null", "").replace("int,", "whole number,")


def _is_struct(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Struct)


def _must(field: FieldInfo) -> bool:
    return field.default is NODEFAULT and field.default_factory is NODEFAULT


def _shown(value: object) -> str:
    text = str(value)
    return text if len(text) <= SHOWN_MAX else f"{text[: SHOWN_MAX - 3]}..."
