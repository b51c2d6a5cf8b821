"""Files for their owner only."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

ISSUED = "issued"
"""In a fleet's folder of keys: everybody's, and so the operator's own `--keys`."""


def private_folder(path: Path) -> None:
    """Made, and for its owner only. Raises OSError."""
    path.mkdir(parents=True, exist_ok=True)
    path.chmod(0o700)


def write_private(path: Path, data: bytes) -> None:
    """0600 from the first byte on, and whole or not at all. Raises OSError."""
    beside = path.with_name(f".{path.name}.new")
    beside.unlink(missing_ok=True)
    with os.fdopen(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data)
    beside.replace(path)


def unpack(folder: Path, files: Mapping[str, str]) -> None:
    """Make `folder` hold exactly these files, by name. Raises OSError."""
    private_folder(folder)
    for path in folder.iterdir():
        if path.name not in files:
            path.unlink()
    for name, text in files.items():
        write_private(folder / Path(name).name, text.encode())
