"""Conversion of wire types to plain JSON for external tools: objects with field names, and matching JSON schemas.

On the wire a struct is an array without names. Here it becomes an object, with its tag as `type`. JSON has no
infinity: a number that is not finite is written as the string "inf", "-inf" or "nan", and the schema allows for it
(a scan's +inf, nothing within range, would otherwise be lost as null). Bytes are base64.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable
from functools import cache
from math import inf, isfinite
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import UNSET, Struct, UnsetType

NonFinite = Literal["inf", "-inf", "nan"]
Number = float | NonFinite
"""JSON number, or the name of a number that JSON lacks; `float()` reads both."""

_encoder = msgspec.json.Encoder()
_WORDS: dict[float, NonFinite] = {inf: "inf", -inf: "-inf"}
_NULL, _INF = b"null", b'"inf"'
_PLAIN = frozenset({int, str, bool, type(None)})


def encode(message: Struct) -> bytes:
    """Return `message` as a JSON object with field names.

    Fast path for nearly all messages, in a quarter of the time: convert to the named type, encode by msgspec. msgspec
    writes null for a number that is not finite, so a message with a null in it that may be one takes the slow path.
    """
    quick = _encoder.encode(_namer(type(message))(message))
    return quick if b"null" not in quick or _is_finite(message) else _encoder.encode(plain(message))


def plain(value: Any) -> Any:
    """Return `value` with structs as dicts, bytes as base64 and non-finite floats as strings."""
    kind = type(value)
    if kind is float:
        return value if value - value == 0.0 else str(value)
    if kind in _PLAIN:
        return value
    if kind is tuple or kind is list:
        return [plain(item) for item in value]
    if kind is bytes:
        return b64encode(value).decode()
    if kind is dict:
        return {str(name): plain(item) for name, item in value.items()}
    if not issubclass(kind, Struct):
        return str(value)
    tag, names = _fields(kind)
    fields = {name: plain(member) for name in names if (member := getattr(value, name)) is not UNSET}
    return fields if tag is None else {"type": tag, **fields}


def restore(body: bytes, kind: type[Struct]) -> Any:
    """Return the message of type `kind` that `encode` wrote as `body`. Raises msgspec.DecodeError for other bytes."""
    return _restored(msgspec.json.decode(body, type=shape(kind)), kind)


def _restored(value: Any, annotation: Any) -> Any:
    if value is None or value is UNSET or annotation is Any:
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
def _namer(kind: type[Struct]) -> Callable[[Any], Struct]:
    """Return the function that converts a `kind` to its `shape`: the same values, under their names.

    It is one expression, generated and compiled once per type, as dataclasses does: one call per field takes three
    times as long, and every recorded message is converted here. Arrays of numbers come out encoded already.
    """
    names: dict[str, Any] = {"numbers": _numbers, "member": _member}
    return eval(f"lambda value: {_renamed(kind, 'value', names)}", names)  # type: ignore[no-any-return]


def _renamed(annotation: Any, value: str, names: dict[str, Any]) -> str:
    """Return the expression that converts `value` of type `annotation`; add the functions it calls to `names`."""
    arguments, origin = get_args(annotation), get_origin(annotation)
    if isinstance(annotation, type) and issubclass(annotation, Struct):
        names[annotation.__name__] = shape(annotation)
        hints = _hints(annotation)
        fields = (_renamed(hints[name], f"{value}.{name}", names) for name in annotation.__struct_fields__)
        return f"{annotation.__name__}({', '.join(fields)})"
    if annotation == tuple[float, ...]:
        return f"numbers({value})"
    if origin is tuple and arguments[-1] is Ellipsis:
        item = _renamed(arguments[0], "item", names)
        return value if item == "item" else f"tuple([{item} for item in {value}])"
    holds_struct = any(isinstance(a, type) and issubclass(a, Struct) for a in arguments)
    return f"member({value})" if origin in (Union, UnionType) and holds_struct else value


def _member(value: Any) -> Any:
    """Convert a value of a union by its type at run time."""
    return _namer(type(value))(value) if isinstance(value, Struct) else value


def _is_finite(value: Struct) -> bool:
    """Return True if every null that msgspec writes for `value` is a None, as in most messages of a lease."""
    return _finiteness(type(value))(value)


@cache  # bounded by the number of types in the program
def _finiteness(kind: type[Struct]) -> Callable[[Any], bool]:
    """Return the function that is `_is_finite` for a `kind`: one expression, which passes over a chain of members."""
    names: dict[str, Any] = {"isfinite": isfinite, "finite_member": _finite_member}
    return eval(f"lambda value: {_finite(kind, 'value') or 'True'}", names)  # type: ignore[no-any-return]


def _finite(annotation: Any, value: str) -> str:
    """Return the expression that is False if `value` of type `annotation` may hold a number that is not finite.

    It is empty where there is nothing to look at. Arrays of numbers are converted by `_numbers`, and make no null.
    """
    arguments, origin = get_args(annotation), get_origin(annotation)
    if isinstance(annotation, type) and issubclass(annotation, Struct):
        hints = _hints(annotation)
        parts = [_finite(hints[name], f"{value}.{name}") for name in annotation.__struct_fields__]
        return " and ".join(part for part in parts if part)
    if annotation is float:
        return f"isfinite({value})"
    if isinstance(annotation, type) or origin is Literal or annotation == tuple[float, ...]:
        return "" if origin is Literal or annotation not in (dict, list, tuple) else "False"
    if origin is tuple and arguments[-1] is Ellipsis:
        item = _finite(arguments[0], "item")
        return f"all([{item} for item in {value}])" if item else ""
    if origin in (Union, UnionType):
        return f"finite_member({value})" if any(_finite(one, "item") for one in arguments) else ""
    return "False"


def _finite_member(value: Any) -> bool:
    """Return `_is_finite` of a value of a union, by its type at run time."""
    if isinstance(value, Struct):
        return _is_finite(value)
    return value is None or (isinstance(value, float) and isfinite(value)) or isinstance(value, int | str)


def _numbers(values: tuple[float, ...]) -> msgspec.Raw:
    """Encode an array of numbers without a step per item: beams and heights are most of all recorded numbers.

    msgspec writes null for each that is not finite; nearly always each of these is a beam with nothing in its range.
    """
    quick = _encoder.encode(values)
    if _NULL in quick:
        if quick.count(_NULL) == values.count(inf):
            return msgspec.Raw(quick.replace(_NULL, _INF))
        # value - value is nan (true) for a value that is not finite, and 0 (false) otherwise.
        quick = _encoder.encode([_WORDS.get(value, "nan") if value - value else value for value in values])
    return msgspec.Raw(quick)


@cache  # bounded by the number of types in the program
def shape(kind: type[Struct]) -> type[Struct]:
    """Return the type of the JSON that `encode` writes for `kind`: same fields by name, floats as `Number`."""
    hints = get_type_hints(kind)
    config = kind.__struct_config__
    fields = [
        (name, _shape_of(hints[name]), *((UNSET,) if UnsetType in get_args(hints[name]) else ()))
        for name in kind.__struct_fields__
    ]
    return msgspec.defstruct(kind.__name__, fields, tag=config.tag, namespace={"__doc__": kind.__doc__}, gc=False)


def schema(kind: type[Struct]) -> bytes:
    """Return the JSON schema of the objects that `encode` writes for `kind`."""
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
