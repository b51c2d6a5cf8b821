"""Bounded reading of a TOML file written by a person."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from lfa.protocol.errors import Refused

FILE_BYTES_MAX = 4 * 1024 * 1024


def read_toml(path: Path, kind: str) -> dict[str, Any]:
    """Read the file as TOML. Raises Refused, naming `kind`, if it cannot be read, is too long or is not TOML."""
    try:
        with path.open("rb") as file:
            text = file.read(FILE_BYTES_MAX + 1)
    except OSError as error:
        raise Refused(f"{path}: cannot be read ({error.strerror or error}): must be {kind} in TOML") from None
    if len(text) > FILE_BYTES_MAX:
        raise Refused(f"{path}: longer than {FILE_BYTES_MAX} bytes: must be {kind} in TOML")
    try:
        return tomllib.loads(text.decode())
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise Refused(f"{path}: no TOML ({' '.join(str(error).split())}): must be {kind} in TOML") from None
