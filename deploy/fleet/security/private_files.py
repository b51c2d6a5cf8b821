"""Files and folders that only their owner can read."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

ISSUED = "issued"
"""Subfolder of a fleet's keys with those of every member: the operator's `--keys`."""


def private_folder(path: Path) -> None:
    """Create the folder if it is missing, with mode 0700. Raises OSError."""
    path.mkdir(parents=True, exist_ok=True)
    path.chmod(0o700)


def write_private(path: Path, data: bytes) -> None:
    """Write a file atomically, with mode 0600 from its creation on. Raises OSError."""
    beside = path.with_name(f".{path.name}.new")
    beside.unlink(missing_ok=True)
    with os.fdopen(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data)
    beside.replace(path)


def unpack(folder: Path, files: Mapping[str, str]) -> None:
    """Make `folder` contain exactly these files, by name. Raises OSError."""
    private_folder(folder)
    for path in folder.iterdir():
        if path.name not in files:
            path.unlink()
    for name, text in files.items():
        write_private(folder / Path(name).name, text.encode())
