"""Wire types as plain JSON for people's tools: objects with field names, and JSON schemas that say the same.

On the wire a struct is an array without names. Here it becomes an object, with its tag as `type`. JSON has no
infinity: a number that is not finite is written as the string "inf", "-inf" or "nan", and the schema says so
(a scan's +inf, nothing within range, would otherwise be lost as null). Bytes are base64.
"""

from __future__ import annotations

from base64 import b64encode
from functools import cache
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct

NonFinite = Literal["inf", "-inf", "nan"]
Number = float | NonFinite
"""A JSON number, or the name of one that JSON does not have; `float()` reads both."""

_encoder = msgspec.json.Encoder()
_PLAIN = frozenset({int, str, bool, type(None)})


def encode(message: Struct) -> bytes:
    """`message` as a JSON object with field names.

    Nearly all go the quick way, a third of the time: renamed and written by msgspec. It writes null for what is not
    finite, and cannot tell the members of a union apart; such a message goes the thorough way.
    """
    kind = type(message)
    if not _holds_union(kind):
        quick = _encoder.encode(msgspec.convert(message, shape(kind), from_attributes=True))
        if b"null" not in quick:
            return quick
    return _encoder.encode(plain(message))


def plain(value: Any) -> Any:
    """`value` with structs as dicts and non-finite floats as strings."""
    kind = type(value)
    if kind is float:
        return value if value - value == 0.0 else str(value)
    if kind in _PLAIN:
        return value
    if kind is tuple or kind is list:
        # Beams and heights are by far the most of all numbers, and need no call each.
        return [plain(item) if type(item) is not float else item if item - item == 0.0 else str(item) for item in value]
    if kind is bytes:
        return b64encode(value).decode()
    if kind is dict:
        return {str(name): plain(item) for name, item in value.items()}
    if not issubclass(kind, Struct):
        return str(value)
    tag, names = _fields(kind)
    fields = {name: plain(getattr(value, name)) for name in names}
    return fields if tag is None else {"type": tag, **fields}


def restore(body: bytes, kind: type[Struct]) -> Any:
    """The message of type `kind` that `encode` made `body` of. Raises msgspec.DecodeError when it is none."""
    return _restored(msgspec.json.decode(body, type=shape(kind)), kind)


def _restored(value: Any, annotation: Any) -> Any:
    if value is None or annotation is Any:
        return value
    if annotation is float:
        return float(value)
    if isinstance(annotation, type) and issubclass(annotation, Struct):
        hints = _hints(annotation)
        return annotation(**{name: _restored(getattr(value, name), hints[name]) for name in hints})
    arguments, origin = get_args(annotation), get_origin(annotation)
    if origin in (Union, UnionType):
        structs = {shape(a): a for a in arguments if isinstance(a, type) and issubclass(a, Struct)}
        other = next((a for a in arguments if a is not type(None)), Any)
        return _restored(value, structs.get(type(value), other))
    if origin is tuple:
        kinds = [arguments[0]] * len(value) if arguments[-1] is Ellipsis else arguments
        return tuple(_restored(item, kind) for item, kind in zip(value, kinds, strict=True))
    if origin is dict:
        return {name: _restored(item, arguments[1]) for name, item in value.items()}
    return value


@cache  # bounded by the number of types in the program
def _hints(kind: type[Struct]) -> dict[str, Any]:
    return get_type_hints(kind)


@cache  # bounded by the number of types in the program
def _fields(kind: type[Struct]) -> tuple[str | None, tuple[str, ...]]:
    return kind.__struct_config__.tag, kind.__struct_fields__  # type: ignore[return-value]


@cache  # bounded by the number of types in the program
def _holds_union(kind: type[Struct]) -> bool:
    """Somewhere in `kind`, a field may be one of several structs."""
    return any(_in_union(annotation) for annotation in get_type_hints(kind).values())


def _in_union(annotation: Any) -> bool:
    if isinstance(annotation, type) and issubclass(annotation, Struct):
        return _holds_union(annotation)
    arguments = get_args(annotation)
    structs = [a for a in arguments if isinstance(a, type) and issubclass(a, Struct)]
    several = get_origin(annotation) in (Union, UnionType) and len(structs) > 1
    return several or any(_in_union(argument) for argument in arguments)


@cache  # bounded by the number of types in the program
def shape(kind: type[Struct]) -> type[Struct]:
    """The type of what `encode` writes for `kind`: same fields by name, floats as `Number`."""
    hints = get_type_hints(kind)
    config = kind.__struct_config__
    fields = [(name, _shape_of(hints[name])) for name in kind.__struct_fields__]
    return msgspec.defstruct(kind.__name__, fields, tag=config.tag, namespace={"__doc__": kind.__doc__})


def schema(kind: type[Struct]) -> bytes:
    """JSON schema of what `encode` writes for `kind`."""
    return msgspec.json.encode(msgspec.json.schema(shape(kind)))


def _shape_of(annotation: Any) -> Any:
    if annotation is float:
        return Number
    if isinstance(annotation, type) and issubclass(annotation, Struct):
        return shape(annotation)
    arguments = tuple(_shape_of(argument) for argument in get_args(annotation))
    origin = get_origin(annotation)
    if origin in (Union, UnionType):
        return Union[arguments]  # noqa: UP007 (made at run time from a tuple)
    return origin[arguments] if origin in (tuple, dict) else annotation
