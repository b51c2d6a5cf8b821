"""A mistake in a file, the rules that find mistakes in its values, and the refusal of a file with all of its mistakes.

Keys are written as in `--set`: `world.obstacles[2].radius_m`, `restart.robot2`, `hosts.laptop.port`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from math import inf, isfinite
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

from msgspec import Struct

from lfa.protocol.errors import Refused

T = TypeVar("T")
SHOWN_MAX = 60


class Mistake(NamedTuple):
    """One mistake. `key + says` is its sentence: `radio.loss` and ` = 2: must be a number from 0 to 1`."""

    key: str
    says: str
    reads: tuple[str, ...] | None = None
    """Keys that the rule compares, when these are others than `key` alone."""
    means: str | None = None
    """Key that was probably meant by an unknown one; empty if none is similar."""

    @property
    def compared(self) -> tuple[str, ...]:
        """Keys whose values the mistake is about."""
        return (self.key,) if self.reads is None else self.reads

    @property
    def spoiled(self) -> str:
        """Key whose value cannot be relied on; empty for an unknown key that stands for none."""
        return self.key if self.means is None else self.means

    def __str__(self) -> str:
        return f"{self.key}{self.says}"


def wrong(key: str, value: object, right: str, *also: str) -> Mistake:
    """Return the mistake that `key` has `value` and must be `right`; `also` are other keys that the rule compares."""
    return Mistake(key, f" = {shown(value)}: must be {right}", (key, *also))


def shown(value: object) -> str:
    """Return a value as text, cut to `SHOWN_MAX` characters."""
    text = str(value)
    return text if len(text) <= SHOWN_MAX else f"{text[: SHOWN_MAX - 3]}..."


class Range(NamedTuple):
    """Bounds of a number; `bound` is the key that one of them comes from."""

    key: str
    value: float
    low: float
    high: float
    bound: str = ""


def out_of_range(ranges: Iterable[Range]) -> Iterator[Mistake]:
    """Yield the numbers out of their range; one whose bound is itself out of range is not judged."""
    bad: set[str] = set()
    for key, value, low, high, bound in sorted(ranges, key=lambda one: bool(one.bound)):
        if bound not in bad and not (isfinite(value) and low <= value <= high):
            bad.add(key)
            right = f"a number from {low:g} to {high:g}" if high < inf else f">= {low:g}"
            yield wrong(key, value, right, *([bound] if bound else []))


class RefusedValue(Refused):
    """Refusal of one value, by a function that stops at its first mistake."""

    def __init__(self, mistake: Mistake) -> None:
        self.mistake = mistake
        super().__init__(str(mistake))


class Rule(NamedTuple, Generic[T]):
    """A check of values beyond their types. It is skipped while a value at one of the keys `reads` is mistaken."""

    check: Callable[[T], Iterable[Mistake]]
    reads: tuple[str, ...] = ()


def apply_rules(rules: Iterable[Rule[T]], value: T, mistakes: list[Mistake]) -> None:
    """Add the mistakes that `rules` find in `value`, except those about a value that was mistaken before its rule."""
    for rule in rules:
        known = spoiled(mistakes)
        if not overlap(rule.reads, known):
            mistakes += [found for found in rule.check(value) if not overlap(found.compared, known)]


def spoiled(mistakes: Iterable[Mistake]) -> tuple[str, ...]:
    """Return the keys whose values cannot be relied on."""
    return tuple(mistake.spoiled for mistake in mistakes if mistake.spoiled)


def overlap(keys: Iterable[str], others: Collection[str]) -> bool:
    """Return True if a key is one of `others`, lies in one, or holds one."""
    return any(_holds(key, other) or _holds(other, key) for key in keys for other in others)


def _holds(table: str, key: str) -> bool:
    return key.startswith(table) and key[len(table) : len(table) + 1] in ("", ".", "[")


class FileError(Struct, frozen=True, omit_defaults=True):
    """One mistake of a file, for `--json`."""

    file: str
    """Path or name of the file; with ` with --set` or as an option when the command line set the value."""
    text: str
    """Key, value and what would be right."""
    line: int = 0
    """Line in the file, from 1; 0: not of the file."""
    key: str = ""

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.text}" if self.line else f"{self.file}: {self.text}"


class RefusedFile(Refused):
    """Refusal of a file with all of its mistakes, in the order of their lines."""

    def __init__(self, errors: Iterable[FileError]) -> None:
        self.errors = tuple(sorted(errors, key=lambda error: error.line))
        super().__init__("; ".join(map(str, self.errors)))

    @property
    def lines(self) -> tuple[str, ...]:
        return tuple(map(str, self.errors))


def refuse_file(path: Path, text: str, line: int = 0) -> RefusedFile:
    """Return the refusal of a file with one mistake that is none of a key."""
    return RefusedFile((FileError(str(path), text, line),))
