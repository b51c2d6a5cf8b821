"""All mistakes of a document are found at once, and none that only follows from another."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import pytest
from msgspec import Struct, field

from lfa.protocol.config_file.conversion import convert
from lfa.protocol.config_file.mistake import Mistake, Range, Rule, apply_rules, out_of_range, wrong


class Wheel(Struct, frozen=True):
    radius: float
    spokes: int = 8


class Cart(Struct, frozen=True):
    size: tuple[float, float]
    wheels: tuple[Wheel, ...] = ()
    colour: Literal["red", "blue"] = "red"
    load: float | None = None
    gains: dict[str, float] = {}
    spare: Wheel = Wheel(1.0)
    kept: bool = field(default=False, name="keep")


GOOD = {"size": [1, 2.5], "wheels": [{"radius": 1}], "colour": "blue", "load": 3, "gains": {"k": 1}, "keep": True}


def mistakes(document: dict[str, Any]) -> list[str]:
    return [str(mistake) for mistake in convert(document, Cart)[1]]


def test_a_right_document_becomes_its_struct_with_whole_numbers_as_floats() -> None:
    cart, found = convert(GOOD, Cart)
    assert not found
    assert cart == Cart((1.0, 2.5), (Wheel(1.0),), "blue", 3.0, {"k": 1.0}, kept=True)
    assert type(cart.size[0]) is float


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("size", [1], "size = [1]: must be a list of length 2, not 1"),
        ("size", [1, "x"], "size[1] = x: must be a number, not text"),
        ("size", 3, "size = 3: must be a list, not a whole number"),
        ("wheels", [{"radius": 1}, 4], "wheels[1] = 4: must be a table, not a whole number"),
        ("wheels", [{"radius": 1, "spokes": 2.5}], "wheels[0].spokes = 2.5: must be a whole number"),
        (
            "wheels",
            [{"radius": 1, "spokes": True}],
            "spokes = True: must be a whole number, not true or false",
        ),
        ("wheels", [{"spokes": 9}], "wheels[0].radius is missing: must be given"),
        ("wheels", [{"radus": 9}], "wheels[0].radus = 9: no such key: did you mean 'radius'?"),
        ("colour", "green", "colour = green: must be one of red, blue"),
        ("colour", 1, "colour = 1: must be one of red, blue"),
        ("load", float("nan"), "load = nan: must be a finite number, at most 1e+09"),
        ("gains", {"k": 1, "b": "x"}, "gains.b = x: must be a number, not text"),
        ("spare", [], "spare = []: must be a table, not a list"),
        ("keep", 1, "keep = 1: must be true or false, not a whole number"),
        ("kept", True, "kept = True: no such key: did you mean 'keep'?"),
        ("zzz", 1, "zzz = 1: no such key: known are size, wheels, colour, load, gains, spare, keep"),
    ],
)
def test_one_wrong_value_is_one_mistake(key: str, value: object, says: str) -> None:
    (said,) = mistakes({**GOOD, key: value})
    assert said.endswith(says)


def test_all_mistakes_are_found_at_once() -> None:
    document = {"size": [1, "x"], "wheels": [{"radius": "y"}, {}], "colour": 1, "lod": 3, "gains": {"k": "z"}}
    assert len(mistakes(document)) == 6


def _rule(cart: Cart) -> Iterator[Mistake]:
    if cart.size[0] * cart.size[1] > 10.0:
        yield wrong("load", cart.load, "none: the cart is too large", "size")
    yield from out_of_range([Range("load", cart.load or 0.0, 1.0, 5.0)])


@pytest.mark.parametrize(
    ("changed", "keys"),
    [
        ({"load": 9}, ["load"]),
        ({"load": "x"}, ["load"]),
        ({"size": [5, 5]}, ["load"]),
        ({"size": [5, "x"], "load": 9}, ["size[1]", "load"]),
        ({"laod": 9, "load": 9}, ["laod"]),
    ],
)
def test_a_rule_says_nothing_of_a_value_that_is_mistaken_already(changed: dict[str, Any], keys: list[str]) -> None:
    cart, found = convert({**GOOD, **changed}, Cart)
    apply_rules([Rule(_rule)], cart, found)
    assert [mistake.key for mistake in found] == keys


def test_a_number_whose_bound_is_out_of_range_is_not_judged() -> None:
    ranges = [Range("inner", 9.0, 0.0, -1.0, "outer"), Range("outer", -1.0, 0.0, 10.0), Range("other", 9.0, 0.0, 1.0)]
    assert [mistake.key for mistake in out_of_range(ranges)] == ["outer", "other"]
