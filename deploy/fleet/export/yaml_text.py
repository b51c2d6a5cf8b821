"""YAML text of plain data, in blocks; every text is quoted as in JSON, so that no value is read as another type."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from json import dumps

Plain = str | int | float | bool | Mapping[str, "Plain"] | Sequence["Plain"]


def yaml_text(value: Plain) -> str:
    """Return `value` as one YAML document."""
    return "\n".join(_lines(value, "")) + "\n"


def _lines(value: Plain, indent: str) -> Iterator[str]:
    match value:
        case Mapping():
            for name, item in value.items():
                yield from _item(f"{indent}{_name(name)}:", item, f"{indent}  ")
        case str() | int() | float():
            yield f"{indent}{_scalar(value)}"
        case _:
            for item in value:
                yield from _item(f"{indent}-", item, f"{indent}  ")


def _item(head: str, item: Plain, indent: str) -> Iterator[str]:
    if isinstance(item, str | int | float):
        yield f"{head} {_scalar(item)}"
    elif not item:
        yield f"{head} {'{}' if isinstance(item, Mapping) else '[]'}"
    else:
        yield head
        yield from _lines(item, indent)


def _name(name: str) -> str:
    return name if _PLAIN_NAME.fullmatch(name) else _scalar(name)


def _scalar(value: str | float | bool) -> str:
    """Return a JSON literal; a text in ASCII, since YAML reads some characters as the ends of lines."""
    text = dumps(value, ensure_ascii=False)
    return _SPECIAL.sub(lambda match: f"\\U{ord(match[0]):08x}", text)


_PLAIN_NAME = re.compile(r"[A-Za-z_-]{3,}")
_SPECIAL = re.compile(r"[^ -~]")
