"""Bounded reading of files that may be damaged: whatever their bytes are, the caller gets a value or `DamagedFile`."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, TypeVar

import msgspec

from lfa.protocol.errors import Refused

FILE_BYTES_MAX = 16 * 1024 * 1024

Decoded = TypeVar("Decoded")


class DamagedFile(ValueError):
    """Content that is too long or not of the expected format; the text says what is wrong, without the path."""


def read_bytes(path: Path, bytes_max: int = FILE_BYTES_MAX) -> bytes:
    """Return the content of a regular file. Raises OSError, and DamagedFile for another kind of file or a longer one.

    A pipe or a device in its place does not block the caller.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except ValueError as error:  # a null byte in the path
        raise DamagedFile(str(error)) from None
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            raise DamagedFile("no regular file")
        # Said by its size before a byte of it is read; /proc has files of size 0 with content, and a file may grow.
        data = b"" if found.st_size > bytes_max else file.read(bytes_max + 1)
    if max(found.st_size, len(data)) > bytes_max:
        raise DamagedFile(f"longer than {bytes_max} bytes")
    return data


def open_binary(path: Path) -> BinaryIO:
    """Open a file to read its bytes. Raises OSError, and ValueError for a null byte in the path.

    A named pipe that nobody writes to is an empty file, in place of blocking for ever; one with a writer is read.
    """
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        os.set_blocking(handle, True)
        return os.fdopen(handle, "rb")
    except OSError:  # a folder
        os.close(handle)
        raise


def read_text(path: Path, bytes_max: int = FILE_BYTES_MAX) -> str:
    """Return a regular file's text in UTF-8. Raises OSError and DamagedFile."""
    try:
        return read_bytes(path, bytes_max).decode()
    except UnicodeDecodeError:
        raise DamagedFile("no text in UTF-8") from None


def read_json(path: Path, kind: type[Decoded], bytes_max: int = FILE_BYTES_MAX) -> Decoded:
    """Return the value of type `kind` in a regular file. Raises OSError and DamagedFile."""
    return decode_json(read_bytes(path, bytes_max), kind)


def read_given_json(
    path: Path, kind: type[Decoded], must: str, *, bytes_max: int = FILE_BYTES_MAX, option: str = ""
) -> Decoded:
    """Return the value of type `kind` in a file that a person has named, by `option` if not by itself.

    Raises Refused with the path, what is wrong and, by `must`, what would be right.
    """
    try:
        return read_json(path, kind, bytes_max)
    except OSError as error:
        reason = error.strerror
    except DamagedFile as error:
        reason = str(error)
    raise Refused(f"{f'{option} {path}'.lstrip()}: {reason}: {must}")


def decode_json(data: bytes, kind: type[Decoded]) -> Decoded:
    """Return the value of type `kind` in `data`. Raises DamagedFile."""
    with _damage():
        return msgspec.json.decode(data, type=kind)


def decode_msgpack(data: bytes, decoder: msgspec.msgpack.Decoder[Decoded]) -> Decoded:
    """Return the value in `data`. Raises DamagedFile."""
    with _damage():
        return decoder.decode(data)


@contextmanager
def _damage() -> Iterator[None]:
    """Turn what msgspec raises into DamagedFile: ValueError stands for text not in UTF-8, and for huge numbers."""
    try:
        yield
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise DamagedFile(" ".join(str(error).split())) from None
