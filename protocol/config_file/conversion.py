"""Strict conversion of a document (of TOML or JSON) to a Struct, with all of its mistakes and not only the first."""

from __future__ import annotations

from difflib import get_close_matches
from functools import cache
from types import UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import msgspec
from msgspec import NODEFAULT, Struct, UnsetType
from msgspec.structs import FieldInfo, fields

from lfa.protocol.config_file.mistake import Mistake, shown, wrong
from lfa.protocol.config_file.toml_lines import member
from lfa.protocol.file_reading import DamagedFile

S = TypeVar("S", bound=Struct)
NUMBER_MAX = 1e9
"""Largest number in a file, unless its reader allows more. TOML also knows nan and inf, which no field admits."""
DEPTH_MAX = 32
OWN_NAME = "name"
"""Field at the top that holds the file's own name: no key of the file."""

_KINDS: dict[type, str] = {
    bool: "true or false", int: "a whole number", float: "a number", str: "text", dict: "a table", list: "a list",
    tuple: "a list of numbers",
}  # fmt: skip


def convert(
    document: dict[str, Any], struct: type[S], number_max: float = NUMBER_MAX, where: str = ""
) -> tuple[S, list[Mistake]]:
    """Return `document` as `struct`, and its mistakes: unknown and missing keys, wrong types, endless numbers.

    `where` is the key at which the document would stand in a whole file, such as `mission`.
    A mistaken value is replaced by its default, a required one by zero, so that rules can check the other values
    (`mistake.apply_rules`). A field of type Any takes every value; its reader checks it.
    """
    converter = _Converter(number_max)
    return cast(S, converter.table(document, struct, where)), converter.mistakes


def without_nulls(document: dict[str, Any], depth_max: int = DEPTH_MAX) -> dict[str, Any]:
    """Return a document of JSON without the keys that are null: they are not given, and TOML has no null.

    Raises DamagedFile for tables nested more than `depth_max` deep, which no type has.
    """
    if depth_max == 0:
        raise DamagedFile(f"nested more than {DEPTH_MAX} deep")
    return {
        key: without_nulls(value, depth_max - 1) if isinstance(value, dict) else value
        for key, value in document.items()
        if value is not None
    }


class _Converter:
    def __init__(self, number_max: float) -> None:
        self.mistakes: list[Mistake] = []
        self._number_max = number_max

    def table(self, given: dict[str, Any], struct: type[Struct], where: str) -> Struct:
        known = {f.encode_name: f for f in fields(struct) if where or f.encode_name != OWN_NAME}
        meant = {key: close for key in given if key not in known for close in get_close_matches(key, known, n=1)}
        for key in given:
            if key not in known:
                self._unknown(member(where, key), given[key], meant.get(key), where, list(known))
        values = {}
        for key, field in known.items():
            name = member(where, key)
            kind = _hints(struct)[field.name]
            if key in given:
                values[field.name] = self._value(given[key], kind, name, field)
            elif _required(field):
                values[field.name] = _zero(kind)
                if key not in meant.values():
                    self.mistakes.append(Mistake(name, " is missing: must be given"))
        return struct(**values)

    def _unknown(self, name: str, value: Any, meant: str | None, where: str, known: list[str]) -> None:
        hint = f"known are {', '.join(known)}" if meant is None else f"did you mean {meant!r}?"
        meant_key = "" if meant is None else member(where, meant)
        self.mistakes.append(Mistake(name, f" = {shown(value)}: no such key: {hint}", means=meant_key))

    def _value(self, value: Any, kind: Any, name: str, field: FieldInfo | None = None) -> Any:
        """Return `value` as `kind`; after a mistake the default of its `field`, else zero."""
        if kind is Any:
            return value
        kind = _chosen(value, _given(kind))
        origin = get_origin(kind)
        right = self._right(value, kind, origin)
        if right:
            self.mistakes.append(wrong(name, value, right))
            return _zero(kind) if field is None or _required(field) else _default(field)
        if _is_struct(kind):
            return self.table(value, kind, name)
        if origin is tuple:
            inner = get_args(kind)
            kinds = [inner[0]] * len(value) if Ellipsis in inner else inner
            return tuple(self._value(v, k, member(name, n)) for n, (v, k) in enumerate(zip(value, kinds, strict=True)))
        if origin is dict:
            return {key: self._value(item, get_args(kind)[1], member(name, key)) for key, item in value.items()}
        return float(value) if kind is float else value

    def _right(self, value: Any, kind: Any, origin: Any) -> str:
        """Return what would be right instead of `value`, as far as itself and not its members say; else nothing."""
        if origin in (Union, UnionType):
            return " or ".join(_KINDS[get_origin(one) or one] for one in get_args(kind))
        if origin is Literal:
            choices = get_args(kind)
            return "" if value in choices and type(value) is str else f"one of {', '.join(map(str, choices))}"
        expected = dict if _is_struct(kind) or origin is dict else list if origin is tuple else kind
        fits = type(value) is expected or (expected is float and type(value) is int)
        if not fits:
            found = "" if type(value) is float else f", not {_KINDS.get(type(value), 'a date or time')}"
            return f"{_KINDS[expected]}{found}"
        if expected in (int, float) and not abs(value) <= self._number_max:
            return f"a finite number, at most {self._number_max:g}"
        inner = get_args(kind)
        if origin is tuple and Ellipsis not in inner and len(value) != len(inner):
            return f"a list of length {len(inner)}, not {len(value)}"
        return ""


@cache  # bounded by the number of types in the program
def _hints(struct: type[Struct]) -> dict[str, Any]:
    return get_type_hints(struct)


def _given(kind: Any) -> Any:
    """Return `kind` without None and UNSET: for `float | None` the type of a value that is given."""
    if get_origin(kind) in (Union, UnionType):
        return Union[tuple(one for one in get_args(kind) if one not in (type(None), UnsetType))]  # noqa: UP007
    return kind


def _chosen(value: Any, kind: Any) -> Any:
    """Return the member of a union that the type of `value` chooses; `kind` itself if it is none, or if none fits."""
    if get_origin(kind) not in (Union, UnionType):
        return kind
    meant = {int: float, list: tuple}.get(type(value), type(value))
    return next((one for one in get_args(kind) if (get_origin(one) or one) is meant), kind)


def _zero(kind: Any) -> Any:
    """Return a stand-in for a required value that is mistaken: zeros, and the first word of a choice."""
    kind, origin, inner = _given(kind), get_origin(_given(kind)), get_args(_given(kind))
    if _is_struct(kind):
        return kind(**{f.name: _zero(_hints(kind)[f.name]) for f in fields(kind) if _required(f)})
    if origin is Literal:
        return inner[0]
    if origin is tuple:
        return () if Ellipsis in inner else tuple(map(_zero, inner))
    return (origin or kind)()


def _default(field: FieldInfo) -> Any:
    return field.default if field.default is not NODEFAULT else field.default_factory()


def _required(field: FieldInfo) -> bool:
    return field.default is NODEFAULT and field.default_factory is NODEFAULT


def _is_struct(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)
