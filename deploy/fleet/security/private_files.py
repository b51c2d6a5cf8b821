"""Files and folders that only their owner can read."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from lfa.deploy.whole_output import whole_file
from lfa.protocol.errors import Refused

ISSUED = "issued"
"""Subfolder of a fleet's keys with those of every member: the operator's `--keys`."""


def private_folder(path: Path) -> None:
    """Make the folder, which may exist, one of mode 0700. Raises OSError, and Refused for that of another user.

    A link to a folder of one's own will do, unless another user has set it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with suppress(FileExistsError):
        path.mkdir(mode=0o700)
    handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        me = os.geteuid()
        owners = (os.fstat(handle).st_uid, path.lstat().st_uid)
        if owners[0] != me or owners[1] not in (me, 0):
            foreign = next(owner for owner in owners if owner != me)
            raise Refused(f"{path}: of user {foreign}: must be your own folder, or a new one")
        os.fchmod(handle, 0o700)
    finally:
        os.close(handle)


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
