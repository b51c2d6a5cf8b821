"""Run folder: its path, its description, and its scenario as a file that can be run again."""

from __future__ import annotations

import shutil
import time
from math import isfinite
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from lfa.deploy.own_code import chosen_files
from lfa.deploy.recording.provenance import Provenance
from lfa.deploy.whole_output import whole_folder
from lfa.protocol.errors import Refused
from lfa.world.description.load import Scenario, load

SCENARIO = "scenario.toml"
JOURNALS = "journal"
LOGS = "logs"
RUNS = Path("runs")


class About(Struct, frozen=True):
    """Description of a run, written to the recording and the summary."""

    scenario: str
    mode: str
    seed: int
    fleet: str
    provenance: Provenance | None = None

    def metadata(self) -> dict[str, str]:
        """Return what the recording says: equal for equal runs, so nothing of where and when it was made."""
        return {"scenario": self.scenario, "mode": self.mode, "seed": str(self.seed), "fleet": self.fleet}


def make(out: Path | None, scenario: Scenario) -> Path:
    """Create and return a folder with the scenario in it: `out` or `runs/<scenario>-<time>`, with -2, -3 ... if taken.

    Files of plug-ins that are not installed are copied into it. Raises Refused when it cannot be created.
    """
    path = out or RUNS / f"{scenario.name}-{time.strftime('%Y%m%d-%H%M%S')}"
    try:
        path = _free(path)
        with whole_folder(path) as fresh:
            (fresh / SCENARIO).write_text(toml(scenario), encoding="utf-8")
            for own_path in {file.path for file in chosen_files(scenario)}:
                shutil.copy(own_path, fresh)
    except OSError as error:
        raise Refused(f"--out {path}: cannot be made ({error.strerror}), give a place to write to") from None
    return path


def scenario_of(folder: Path) -> Scenario:
    """Return the scenario of a run, as drawn."""
    return load(str(folder / SCENARIO))


def toml(scenario: Scenario) -> str:
    """Return `scenario` in TOML with every field; `lfa.world.description.load.load` reads it back."""
    fields: dict[str, Any] = msgspec.to_builtins(scenario)
    fields.pop("name")
    tables = {name: value for name, value in fields.items() if isinstance(value, dict)}
    plain = {name: value for name, value in fields.items() if name not in tables}
    return "\n".join([_lines(plain), *(f"[{name}]\n{_lines(table)}" for name, table in tables.items())])


def _lines(fields: dict[str, Any]) -> str:
    return "".join(f"{name} = {toml_value(value)}\n" for name, value in fields.items() if value is not None)


def toml_value(value: Any) -> str:
    """Return a value as TOML writes it; members of a table that are None are left out."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {toml_value(v)}" for k, v in value.items() if v is not None) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    if isinstance(value, float) and not isfinite(value):
        return str(value)  # nan, inf, -inf
    return msgspec.json.encode(value).decode()


def _free(path: Path) -> Path:
    """Return `path`, with a numeric suffix if it is taken. Raises Refused for a taken path without a name, like `.`."""
    if path.name in ("", "..") and not _empty(path):
        raise Refused(f"--out {path}: is not empty, must be a new or an empty folder")
    suffix, candidate = 1, path
    while candidate.exists() and not _empty(candidate):
        suffix += 1
        candidate = path.with_name(f"{path.name}-{suffix}")
    return candidate


def _empty(path: Path) -> bool:
    return path.is_dir() and not any(path.iterdir())
