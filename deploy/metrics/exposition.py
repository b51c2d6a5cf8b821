"""OpenMetrics text (version 1.0.0) of metric families. Pure.

Source: https://github.com/prometheus/OpenMetrics/blob/main/specification/OpenMetrics.md
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import inf, isnan
from typing import Literal

from msgspec import Struct

CONTENT_TYPE = "application/openmetrics-text; version=1.0.0; charset=utf-8"


class Family(Struct, frozen=True):
    """Row of the table of metrics: name without the suffix of its type, type, unit (the name's end) and help."""

    name: str
    kind: Literal["gauge", "counter", "info"]
    unit: str
    text: str


class MetricSample(Struct, frozen=True):
    """One value of a family, with its labels."""

    family: Family
    value: float
    labels: tuple[tuple[str, str], ...] = ()


_SUFFIX = {"gauge": "", "counter": "_total", "info": "_info"}


def openmetrics(families: Sequence[Family], samples: Iterable[MetricSample]) -> str:
    """Return the text of all `families` with their `samples`; a family without any is left out.

    Of two samples with the same labels, the later one counts: a reader refuses a text with both.
    """
    by_family: dict[str, dict[tuple[tuple[str, str], ...], float]] = {}
    for sample in samples:
        by_family.setdefault(sample.family.name, {})[sample.labels] = sample.value
    lines: list[str] = []
    for family in families:
        if family.name in by_family:
            lines += _lines(family, by_family[family.name])
    return "\n".join([*lines, "# EOF", ""])


def _lines(family: Family, values: Mapping[tuple[tuple[str, str], ...], float]) -> Iterator[str]:
    yield f"# TYPE {family.name} {family.kind}"
    if family.unit:
        yield f"# UNIT {family.name} {family.unit}"
    yield f"# HELP {family.name} {_escaped(family.text)}"
    for labels in sorted(values):
        pairs = ",".join(f'{name}="{_escaped(text)}"' for name, text in labels)
        yield f"{family.name}{_SUFFIX[family.kind]}{f'{{{pairs}}}' if pairs else ''} {_number(values[labels])}"


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace("\n", "\\n").replace('"', '\\"')


def _number(value: float) -> str:
    if isnan(value):
        return "NaN"
    if value in (inf, -inf):
        return "+Inf" if value > 0 else "-Inf"
    return repr(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))
