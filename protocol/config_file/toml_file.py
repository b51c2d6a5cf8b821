"""Bounded reading of a TOML file written by a person, with the line of each key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from lfa.protocol.config_file.mistake import FileError, Mistake, RefusedFile, refuse_file
from lfa.protocol.config_file.toml_lines import lines_of, member
from lfa.protocol.file_reading import open_binary

FILE_BYTES_MAX = 4 * 1024 * 1024
_LAST_PART = re.compile(r"(\.[^.\[\]]*|\[\d+\])$")
_PLACE = re.compile(r" \(at line (\d+), column \d+\)$")


class TomlFile(NamedTuple):
    """A TOML file that could be read."""

    path: Path
    document: dict[str, Any]
    lines: dict[str, int]
    """Line of each key and list item, by its name as in `world.obstacles[2].radius_m`."""

    def line(self, key: str) -> int:
        """Return the line of `key`, or of the nearest table or list around it that the file has; 1 if it has none."""
        while key and key not in self.lines:
            shorter = _LAST_PART.sub("", key)
            key = shorter if shorter != key else ""
        return self.lines.get(key, 1)

    def under(self, table: str) -> TomlFile:
        """Return this file with its keys named as if it were the `table` of another one."""
        return self._replace(lines={member(table, key): line for key, line in self.lines.items()})

    def error(self, mistake: Mistake, name: str = "") -> FileError:
        """Return a mistake with its place; `name` is shown for the file instead of its path."""
        return FileError(name or str(self.path), str(mistake), self.line(mistake.key), mistake.key)

    def refuse(self, mistakes: Iterable[Mistake]) -> RefusedFile:
        """Return the refusal of this file."""
        return RefusedFile(self.error(mistake) for mistake in mistakes)


def read_toml(path: Path, kind: str) -> TomlFile:
    """Read the file as TOML. Raises RefusedFile, naming `kind`, if it cannot be read, is too long, empty or no TOML."""
    right = f"must be {kind} in TOML"
    try:
        with open_binary(path) as file:
            data = file.read(FILE_BYTES_MAX + 1)
    except OSError as error:
        raise refuse_file(path, f"cannot be read ({error.strerror or error}): {right}") from None
    if len(data) > FILE_BYTES_MAX:
        raise refuse_file(path, f"longer than {FILE_BYTES_MAX} bytes: {right}")
    try:
        text = data.decode().replace("\r\n", "\n")
        read = TomlFile(path, tomllib.loads(text), lines_of(text))
    except (ValueError, RecursionError) as error:  # ValueError: also a number of thousands of digits
        said = " ".join(str(error).split())
        place = _PLACE.search(said)
        wrong = f"no TOML ({_PLACE.sub('', said)}): {right}"
        raise refuse_file(path, wrong, int(place[1]) if place else 0) from None
    if not read.document:  # also a pipe that nobody writes to
        raise refuse_file(path, f"holds no key: {right}")
    return read
