"""Plan of a sweep from a command line: `--seeds 1..100 --set a=1,2,3`."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lfa.protocol.config_file.toml_file import TomlFile
from lfa.protocol.errors import Refused

TITLE = "command line"
POINTS = ("start", "goal")
"""Short names whose value is a point: its commas part coordinates."""


def plan_file(
    scenario: str, seeds: str, overrides: Sequence[str], robots: int | None, faults: Sequence[str]
) -> TomlFile:
    """Return the plan that the options of a command line mean. Raises Refused for an override that is none."""
    fixed: dict[str, Any] = {}
    grid: dict[str, Any] = {}
    for override in overrides:
        key, equals, text = override.partition("=")
        key, values = key.strip(), split(text) if key.strip() not in POINTS else [text]
        if not equals or not key or not all(values):
            raise Refused(f"--set {override!r}: must be key=value, or key=value,value for several groups of runs")
        if key in fixed or key in grid:
            raise Refused(f"--set {override!r}: {key} is set twice: must be set once")
        if key in POINTS:
            fixed[key] = _value(text if text.strip().startswith("[") else f"[{text}]")
        elif len(values) == 1:
            fixed[key] = _value(values[0])
        else:
            grid[key] = [_value(value) for value in values]
    document: dict[str, Any] = {"scenario": scenario, "seeds": seeds, "set": fixed, "title": Path(scenario).stem}
    document |= {"grid": grid} if grid else {}
    document |= {"robots": robots} if robots is not None else {}
    document |= {"faults": [list(faults)]} if faults else {}
    return TomlFile(Path(TITLE), document, {})


def split(text: str) -> list[str]:
    """Return the parts of `text` between commas that stand in no brackets and no quotes."""
    parts, depth, quote = [""], 0, ""
    for character in text:
        if quote:
            quote = "" if character == quote else quote
        elif character in "'\"":
            quote = character
        depth += (character in "[{") - (character in "]}") if not quote else 0
        if character == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


def _value(text: str) -> Any:
    """Return a TOML value, or a bare word as text, as `--set` of one run reads it."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text
