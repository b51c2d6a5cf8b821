"""Files and folders that appear whole or not at all: after an error, such as a full disk, nothing is left of them.

Use:
    with whole_folder(Path("keys")) as fresh:
        (fresh / "ca.pem").write_bytes(certificate)      # `keys/ca.pem` exists once the block has ended
"""

from __future__ import annotations

import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole_folder(path: Path, mode: int = 0o777) -> Iterator[Path]:
    """Yield a fresh folder of `mode`, whose entries are in the folder `path` when the block ends without an error.

    A missing `path` is made, with its parents; entries of the same name are replaced. After an error `path` and its
    parents are as they were. Raises OSError, which names `path`.
    """
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    fresh = _fresh(path / "folder" if path.exists() else path)
    whole = False
    try:
        with _named(path):
            fresh.parent.mkdir(parents=True, exist_ok=True)
            fresh.mkdir(mode)
            yield fresh
            if path.exists():
                for entry in sorted(fresh.iterdir()):
                    entry.replace(path / entry.name)
            else:
                fresh.rename(path)
            whole = True
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
        for folder in () if whole else made:
            with suppress(OSError):  # somebody else uses it by now
                folder.rmdir()


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path of the same suffix, whose file is at `path` when the block ends without an error.

    A device or a pipe at `path` is written as such, a link is replaced. Raises OSError, which names `path`.
    """
    fresh = path if path.exists() and not path.is_file() else _fresh(path)
    try:
        with _named(path):
            yield fresh
            if fresh != path:
                fresh.replace(path)
    finally:
        if fresh != path:
            with suppress(OSError):
                fresh.unlink(missing_ok=True)


def _fresh(path: Path) -> Path:
    """Return a path beside `path` that nobody can foresee, with its suffix."""
    return path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Let an OSError name `path`, not the fresh one, of which nobody knows."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
