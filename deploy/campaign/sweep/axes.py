"""Axes of a plan: what varies from group to group, and which scenario keys each value sets. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from math import prod
from typing import Any

from msgspec import Struct

from lfa.protocol.config_file.mistake import Mistake, overlap, shown, wrong
from lfa.protocol.config_file.toml_lines import member

CONTROLLER_KEY = "mission.following.controller"


class AxisValue(Struct, frozen=True):
    """One value of an axis: its text in tables, the scenario keys that it sets, and the faults that it adds."""

    text: str
    where: str
    """Key of the plan that gives the value, as `grid.radio.loss[1]`."""
    sets: tuple[tuple[str, Any], ...] = ()
    faults: tuple[str, ...] = ()


class Axis(Struct, frozen=True):
    """Quantity that varies, with its values in the order of the plan."""

    name: str
    keys: tuple[str, ...]
    """Scenario keys that the axis sets; empty for the faults."""
    values: tuple[AxisValue, ...]
    where: str


def combinations(axes: Sequence[Axis]) -> Iterator[tuple[AxisValue, ...]]:
    """Yield every combination of one value of each axis; the last axis varies fastest."""
    return product(*(axis.values for axis in axes))


def count(axes: Sequence[Axis]) -> int:
    """Return the number of combinations."""
    return prod(len(axis.values) for axis in axes)


def controller_axis(names: Sequence[str]) -> Axis:
    """Return the axis of a list of controllers."""
    values = (AxisValue(name, f"controllers[{n}]", ((CONTROLLER_KEY, name),)) for n, name in enumerate(names))
    return Axis("controller", (CONTROLLER_KEY,), tuple(values), "controllers")


def fault_axis(lists: Sequence[Sequence[str]]) -> Axis:
    """Return the axis of several lists of faults, each added to those of the scenario."""
    values = (
        AxisValue("; ".join(faults) or "none", f"faults[{n}]", faults=tuple(faults)) for n, faults in enumerate(lists)
    )
    return Axis("faults", (), tuple(values), "faults")


def grid_axes(table: object) -> tuple[list[Axis], list[Mistake]]:
    """Return an axis for each key of the table `grid`, and the mistakes in it."""
    axes: list[Axis] = []
    mistakes: list[Mistake] = []
    for key, where, values in _leaves(table, "grid", mistakes):
        texts = [short(value) for value in values]
        mistakes += _twice(where, texts)
        options = (
            AxisValue(text, member(where, n), ((key, value),))
            for n, (text, value) in enumerate(zip(texts, values, strict=True))
        )
        axes.append(Axis(key, (key,), tuple(options), where))
    return axes, mistakes


def list_axes(tables: object) -> tuple[list[Axis], list[Mistake]]:
    """Return an axis for each `[[list]]`, whose keys change together, row by row; and the mistakes in them."""
    axes: list[Axis] = []
    mistakes: list[Mistake] = []
    if not isinstance(tables, list):
        return axes, [wrong("list", tables, "written as [[list]], with a list of values for each key")]
    for n, table in enumerate(tables):
        where = member("list", n)
        columns = list(_leaves(table, where, mistakes))
        lengths = {len(values) for _, _, values in columns}
        if len(lengths) > 1:
            mistakes.append(Mistake(where, f": lists of {sorted(lengths)} values: must be equally long"))
        elif columns:
            axes.append(_together(where, columns))
            mistakes += _twice(where, [value.text for value in axes[-1].values])
    return axes, mistakes


def _together(where: str, columns: Sequence[tuple[str, str, list[Any]]]) -> Axis:
    keys = tuple(key for key, _, _ in columns)
    rows = zip(*(values for _, _, values in columns), strict=True)
    values = (
        AxisValue(", ".join(map(short, row)), member(columns[0][1], n), tuple(zip(keys, row, strict=True)))
        for n, row in enumerate(rows)
    )
    return Axis(", ".join(keys), keys, tuple(values), where)


def shared_keys(axes: Sequence[Axis], fixed: Sequence[tuple[str, str]]) -> Iterator[Mistake]:
    """Yield a mistake for each scenario key that is set twice. `fixed`: keys with their places in the plan."""
    taken = list(fixed)
    for axis in axes:
        for key in axis.keys:
            other = next((where for known, where in taken if overlap((key,), (known,))), None)
            if other is not None:
                where = axis.where if len(axis.keys) == 1 else member(axis.where, key)
                yield Mistake(where, f": {key} is set by {other} too: must be in one of them")
        taken += [(key, axis.where) for key in axis.keys]


def flat(table: dict[str, Any], where: str) -> Iterator[tuple[str, str, Any]]:
    """Yield key in a scenario, key in the plan and value of each entry, whether tables or dots divide its key."""
    for key, value in table.items():
        if isinstance(value, dict) and value:
            for inner, place, found in flat(value, member(where, key)):
                yield member(key, inner), place, found
        else:
            yield key, member(where, key), value


def short(value: object) -> str:
    """Return a value as text for a table: numbers without noise, long lists cut."""
    return f"{value:g}" if isinstance(value, float) else shown(value)


def _leaves(table: object, where: str, mistakes: list[Mistake]) -> Iterator[tuple[str, str, list[Any]]]:
    """Yield key, place and values of each list in a table; everything else is a mistake."""
    if not isinstance(table, dict) or not table:
        mistakes.append(wrong(where, table, "a table with at least one key, and a list of values for each"))
        return
    for key, place, values in flat(table, where):
        if isinstance(values, list) and values:
            yield key, place, values
        else:
            mistakes.append(wrong(place, values, "a list of at least one value"))


def _twice(where: str, texts: Sequence[str]) -> list[Mistake]:
    double = sorted({text for text in texts if texts.count(text) > 1})
    return [Mistake(where, f": {', '.join(double)} stands there twice: must stand there once")] if double else []
