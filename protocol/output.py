"""Lines and files that long-lived processes write: a place that refuses them is reported, and never ends the process.

A full disk, an I/O error, a closed or stuck pipe, a file system that became read-only: the line or the entry is left
out, and the robot, the supervisor or the recorder goes on. Nothing here raises after a file was opened.
"""

from __future__ import annotations

import io
import os
import select
from contextlib import suppress
from pathlib import Path
from typing import TextIO

LINE_BYTES_MAX = 4000
"""Maximum length [bytes] of a line, below the size that a pipe writes atomically."""


HIDDEN = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Unicode categories that a terminal obeys or hides: controls, formats (bidirectional overrides), line separators."""


def visible(text: str) -> str:
    r"""Return `text` with each control or format character written as an escape, such as `\x1b`; a tab stays.

    Those above ASCII have the escapes of JSON (`\u202e`), whose text may hold them; those below are never in it.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(map(_visible, text))


def visible_lines(text: str) -> str:
    """Return `text` with all but its newlines made visible."""
    return "\n".join(map(visible, text.split("\n")))


def _visible(char: str) -> str:
    from unicodedata import category  # for rare texts: no agent loads its tables at the start

    if char == "\t" or category(char) not in HIDDEN:
        return char
    units = char.encode("utf-16-be", errors="surrogatepass")
    if ord(char) < 0x7F:
        return ascii(char)[1:-1]
    return "".join(f"\\u{units[n : n + 2].hex()}" for n in range(0, len(units), 2))


def write_line(text: str, stream: TextIO | None) -> None:
    """Write `text` and a newline to `stream` (`sys.stdout` or `sys.stderr`) at once, or drop it.

    Control characters in it, which may come from other machines, are made visible.

    `stream` is None in a process that was started with that descriptor closed; its number may belong to another file
    by now. A line that a full pipe or a stopped terminal does not take at once is dropped.
    """
    if stream is None:
        return
    text = visible_lines(text)
    with suppress(OSError, ValueError):  # ValueError: the stream was closed
        try:
            out = stream.fileno()
        except io.UnsupportedOperation:  # a stream without descriptor, as in a notebook
            stream.write(f"{text}\n")
            return
        poll = select.poll()
        poll.register(out, select.POLLOUT)
        if [what for _, what in poll.poll(0) if what == select.POLLOUT]:
            os.write(out, text.encode(errors="replace")[:LINE_BYTES_MAX] + b"\n")


def replace_file(path: Path, data: bytes, writer: str = "new") -> str:
    """Replace the file at `path` by `data`, in one step for its readers; return the reason of a failure, else "".

    `writer` ends the name of the file that is written first: writers of one path at one time need different ones.
    """
    fresh = path.with_name(f"{path.name}.{writer}")
    try:
        fresh.unlink(missing_ok=True)  # of a writer that was killed, or a link of another user's
        with os.fdopen(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666), "wb") as file:
            file.write(data)
        fresh.replace(path)
    except OSError as error:
        with suppress(OSError):
            fresh.unlink(missing_ok=True)
        return error.strerror or str(error)
    return ""


class AppendedFile:
    """File that grows by whole pieces: a piece that the file system takes in part only is cut off again."""

    def __init__(self, path: Path, *, fresh: bool = False) -> None:
        """Open the file, with `fresh` an empty one. Raises OSError, also for a link or a pipe in its place."""
        self.path = path
        self.error = ""
        """Reason of the last failure; empty: none."""
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
        self._file: int | None = os.open(path, flags | (os.O_TRUNC if fresh else 0), 0o644)
        self.size = os.fstat(self._file).st_size
        """Size [bytes] of the whole pieces."""

    def append(self, piece: bytes | bytearray) -> bool:
        """Write all of `piece`, or nothing and return False."""
        if self._file is None:
            return False
        written = 0
        try:
            while written < len(piece):
                written += os.write(self._file, piece[written:] if written else piece)
        except OSError as error:
            self.error = error.strerror or str(error)
            self._cut()
            return False
        self.size += len(piece)
        return True

    def close(self) -> None:
        """Close the file; further pieces are refused."""
        if self._file is not None:
            with suppress(OSError):  # a network file system reports a late failure here
                os.close(self._file)
            self._file = None

    def _cut(self) -> None:
        """Remove the part of a piece that was written; a file that cannot be cut takes no more."""
        assert self._file is not None
        try:
            os.ftruncate(self._file, self.size)
        except OSError:
            self.close()
