"""Files and folders that only their owner can read."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from lfa.deploy.whole_output import whole_file

ISSUED = "issued"
"""Subfolder of a fleet's keys with those of every member: the operator's `--keys`."""


def private_folder(path: Path) -> None:
    """Create the folder if it is missing, with mode 0700. Raises OSError."""
    path.mkdir(parents=True, exist_ok=True)
    path.chmod(0o700)


def write_private(path: Path, data: bytes) -> None:
    """Write a file atomically, with mode 0600 from its creation on. Raises OSError."""
    with whole_file(path) as fresh:
        handle = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "wb") as file:
            file.write(data)


def unpack(folder: Path, files: Mapping[str, str]) -> None:
    """Make `folder` contain exactly these files, by name. Raises OSError."""
    private_folder(folder)
    for path in folder.iterdir():
        if path.name not in files:
            path.unlink()
    for name, text in files.items():
        write_private(folder / Path(name).name, text.encode())
